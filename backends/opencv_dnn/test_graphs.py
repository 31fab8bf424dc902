#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-2-Clause
"""Writes small ONNX graphs with the inputs and outputs of known networks, and what they must decode to.

Usage: test_graphs.py FOLDER (needs python3-onnx). Per graph NAME.onnx; NAME.txt holds the expected
instances, decoded here a second time from the description of each network, in double precision:
one line "class score x y width height", then, if it has a mask, its rows as 0 and 1.
The outputs are constants, plus weights times the mean of each input channel.
"""
import os
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

OUT = sys.argv[1]
PICTURE = (80, 60)  # W, H of the image that the test feeds
INPUT = (64, 64)  # W, H of most graphs
RANDOM = np.random.default_rng(20)


def save(name, nodes, weights, inputs, outputs, opset=11):
    values = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in inputs]
    results = [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in outputs]
    graph = helper.make_graph(nodes, name, values, results, weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)])
    model.ir_version = 6
    onnx.save(model, os.path.join(OUT, name + ".onnx"))


def constant_graph(name, outputs, size=INPUT, by_channel=None, open_size=False, channels=3):
    """outputs: {name: array}; by_channel: {name: weights of its numbers on the channels' means}."""
    nodes = [helper.make_node("GlobalAveragePool", ["images"], ["mean"]),
             helper.make_node("Flatten", ["mean"], ["flat"])]
    weights = []
    for key, array in outputs.items():
        factor = (by_channel or {}).get(key)
        factor = np.zeros((array.size, channels)) if factor is None else factor
        weights += [numpy_helper.from_array(factor.astype(np.float32), key + "_w"),
                    numpy_helper.from_array(array.reshape(-1).astype(np.float32), key + "_b"),
                    numpy_helper.from_array(np.array(array.shape, np.int64), key + "_s")]
        nodes += [helper.make_node("Gemm", ["flat", key + "_w", key + "_b"], [key + "_g"], transB=1),
                  helper.make_node("Reshape", [key + "_g", key + "_s"], [key])]
    shape = [1, channels] + (["height", "width"] if open_size else [size[1], size[0]])
    save(name, nodes, weights, [("images", shape)], [(k, a.shape) for k, a in outputs.items()])


class Placement:
    def __init__(self, fit, size=INPUT):
        (pw, ph), (w, h) = PICTURE, size
        self.fw, self.fh, self.ox, self.oy = w, h, 0, 0
        if fit != "stretch":
            r = min(w / pw, h / ph)
            self.fw, self.fh = round(pw * r), round(ph * r)
            if fit == "letterbox":
                self.ox, self.oy = (w - self.fw) // 2, (h - self.fh) // 2
        self.sx, self.sy = self.fw / pw, self.fh / ph

    def box(self, x0, y0, x1, y1):
        """x0, y0, x1, y1 in whole image pixels."""
        pw, ph = PICTURE
        x0 = np.clip((x0 - self.ox) / self.sx + 1e-3, 0, pw)
        x1 = np.clip((x1 - self.ox) / self.sx - 1e-3, 0, pw)
        y0 = np.clip((y0 - self.oy) / self.sy + 1e-3, 0, ph)
        y1 = np.clip((y1 - self.oy) / self.sy - 1e-3, 0, ph)
        return int(np.floor(x0)), int(np.floor(y0)), int(np.ceil(x1)), int(np.ceil(y1))

    def mask(self, soft, box, threshold, x0=0, y0=0, step_x=1, step_y=1):
        """soft: a grid whose upper left corner is (x0, y0) of the input, cells step_x x step_y."""
        bx0, by0, bx1, by1 = box
        u = (((np.arange(bx0, bx1) + 0.5) * self.sx + self.ox) - x0) / step_x - 0.5
        v = (((np.arange(by0, by1) + 0.5) * self.sy + self.oy) - y0) / step_y - 0.5
        h, w = soft.shape
        u, v = np.clip(u, 0, w - 1), np.clip(v, 0, h - 1)
        iu, iv = np.floor(u).astype(int), np.floor(v).astype(int)
        ju, jv = np.minimum(iu + 1, w - 1), np.minimum(iv + 1, h - 1)
        a, b = (u - iu)[None, :], (v - iv)[:, None]
        s = soft.astype(np.float64)
        value = ((1 - b) * ((1 - a) * s[iv][:, iu] + a * s[iv][:, ju]) +
                 b * ((1 - a) * s[jv][:, iu] + a * s[jv][:, ju]))
        return value > threshold


def expect(name, instances):
    """instances: (class, score, box, mask or None); boxes of masks are cut to what is in them."""
    with open(os.path.join(OUT, name + ".txt"), "w") as out:
        for cls, score, (x0, y0, x1, y1), mask in sorted(instances, key=lambda s: -s[1]):
            if mask is not None:
                rows, columns = np.nonzero(mask.any(1))[0], np.nonzero(mask.any(0))[0]
                if len(rows) == 0:
                    continue
                mask = mask[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]
                x0, y0 = x0 + columns[0], y0 + rows[0]
                x1, y1 = x0 + mask.shape[1], y0 + mask.shape[0]
            if x1 <= x0 or y1 <= y0:
                continue
            out.write(f"{cls} {score:.9g} {x0} {y0} {x1 - x0} {y1 - y0} {int(mask is not None)}\n")
            for row in mask if mask is not None else []:
                out.write("".join("1" if v else "0" for v in row) + "\n")


def overlap(a, b):
    w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0
    return w * h / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - w * h)


def suppress(candidates):
    """candidates: (class, score, box in input pixels, ...)."""
    kept = []
    for c in sorted(candidates, key=lambda c: -c[1]):
        if all(k[0] != c[0] or overlap(k[2], c[2]) <= 0.5 for k in kept):
            kept.append(c)
    return kept


def sigmoid(v):
    return 1 / (1 + np.exp(-np.asarray(v, np.float64)))


def blob(shape, x, y, rx, ry, height=1.0):
    """A soft ellipse."""
    v, u = np.mgrid[0:shape[0], 0:shape[1]]
    return height / (1 + np.exp(4 * (((u - x) / rx) ** 2 + ((v - y) / ry) ** 2 - 1)))


def sparse_inst():
    n, (w, h) = 6, INPUT
    scores = RANDOM.uniform(0, 0.25, (1, n, 80))
    masks = RANDOM.uniform(0, 0.2, (1, n, h, w))
    for i, (cls, score) in enumerate([(0, 0.9), (0, 0.8), (56, 0.7), (0, 0.31)]):
        scores[0, i, cls] = score
        masks[0, i] += 0.75 * blob((h, w), 8 + 14 * i, 20 + 8 * i, 9, 12)
    scores[0, 4, 3] = 0.95  # a high score, no pixel
    scores, masks = scores.astype(np.float32), masks.astype(np.float32)
    constant_graph("sparseinst", {"scores": scores, "masks": masks})
    place, found = Placement("top_left"), []
    for i in range(n):
        cls = int(np.argmax(scores[0, i]))
        own = masks[0, i] > np.float32(0.45)
        if scores[0, i, cls] <= 0.3 or not own.any():
            continue
        score = float(scores[0, i, cls]) * float(masks[0, i][own].astype(np.float64).mean())
        whole = (0, 0) + PICTURE
        found.append((cls, score, whole, place.mask(masks[0, i], whole, 0.45)))
    expect("sparseinst", found)


def mask_rcnn():
    n, size = 5, (96, 72)
    boxes = np.zeros((1, 1, n, 7), np.float32)
    masks = RANDOM.uniform(0, 0.3, (n, 90, 15, 15)).astype(np.float32)
    rows = [(0, 0.9, 0.1, 0.2, 0.5, 0.9), (61, 0.8, 0.55, 0.4, 1.1, 1.0), (0, 0.7, -0.1, -0.1, 0.3, 0.6),
            (0, 0.4, 0.2, 0.2, 0.8, 0.8), (16, 0.6, 0.9, 0.9, 0.9, 0.95)]
    for i, (cls, *rest) in enumerate(rows):
        boxes[0, 0, i] = [0, cls] + rest
        masks[i, cls] += (0.65 * blob((15, 15), 7 + i, 7, 6, 7)).astype(np.float32)
    constant_graph("mask_rcnn", {"detection_out_final": boxes, "detection_masks": masks}, size)
    place, found = Placement("stretch", size), []
    for i in range(n):
        cls, score = int(boxes[0, 0, i, 1]), float(boxes[0, 0, i, 2])
        if score < 0.5:
            continue
        x0, y0, x1, y1 = [float(v) * s for v, s in zip(boxes[0, 0, i, 3:], size + size)]
        if x1 <= x0:
            continue
        box = place.box(x0, y0, x1, y1)
        soft = masks[i, cls]
        mask = place.mask(soft, box, 0.5, x0, y0, (x1 - x0) / 15, (y1 - y0) / 15)
        found.append((cls, score, box, mask))
    expect("mask_rcnn", found)


# Class, score, centre, size, in pixels of a 64 x 64 input. The second is the first once more.
OBJECTS = [(0, 0.9, 16, 30, 20, 40), (0, 0.8, 17, 31, 20, 40), (0, 0.7, 48, 32, 24, 30),
           (56, 0.6, 18, 30, 20, 40), (41, 0.1, 32, 32, 10, 10), (32, 0.5, 62, 54, 12, 12),
           (0, 0.5, 32, -20, 10, 10)]


def corners(x, y, w, h):
    return x - w / 2, y - h / 2, x + w / 2, y + h / 2


def prototypes():
    protos = RANDOM.normal(0, 0.3, (1, 32, 16, 16))
    coefficients = RANDOM.normal(0, 0.2, (len(OBJECTS), 32))
    for i, (_, _, x, y, w, h) in enumerate(OBJECTS):
        protos[0, i] = 8 * blob((16, 16), x / 4 - 0.5, y / 4 - 0.5, w / 8, h / 8) - 4
        coefficients[i, :8] = 0
        coefficients[i, i] = 1.3
    return protos.astype(np.float32), coefficients.astype(np.float32)


def masked(place, candidates, protos):
    found = []
    for cls, score, box, c in suppress(candidates):
        soft = sigmoid(np.tensordot(c.astype(np.float64), protos[0].astype(np.float64), 1))
        inside = place.box(*box)
        if inside[2] > inside[0] and inside[3] > inside[1]:
            found.append((cls, score, inside, place.mask(soft, inside, 0.5, 0, 0, 4, 4)))
    return found


def yolo():
    anchors = 64 + 16 + 4
    protos, coefficients = prototypes()
    out = np.zeros((1, 4 + 80 + 32, anchors), np.float32)
    out[0, :4] = 10
    out[0, 4:84] = RANDOM.uniform(0, 0.2, (80, anchors))
    place, candidates, boxes = Placement("letterbox"), [], []
    for i, (cls, score, *box) in enumerate(OBJECTS):
        at = 7 + 11 * i
        out[0, :4, at], out[0, 4 + cls, at], out[0, 84:, at] = box, score, coefficients[i]
        if score >= 0.25:
            candidates.append((cls, float(np.float32(score)), corners(*box), coefficients[i]))
    constant_graph("yolo_seg", {"output0": out, "output1": protos})
    expect("yolo_seg", masked(place, candidates, protos))
    constant_graph("yolo", {"output0": out[:, :84]})
    boxes = [(c[0], c[1], place.box(*c[2]), None) for c in suppress(candidates)]
    expect("yolo", boxes)

    # With objectness, three anchors per cell; the same objects.
    old = np.zeros((1, 3 * anchors, 85), np.float32)
    old[0, :, 4] = 0.1
    for i, (cls, score, *box) in enumerate(OBJECTS):
        old[0, 20 * i, :4], old[0, 20 * i, 4], old[0, 20 * i, 5 + cls] = box, 0.9, score / 0.9
    constant_graph("yolo_objectness", {"output": old})
    expect("yolo_objectness", boxes)


def headless():
    w, h = INPUT
    protos, coefficients = prototypes()
    outputs = {"proto": protos}
    place, candidates = Placement("letterbox"), []
    for stride in (8, 16, 32):
        rows, columns = h // stride, w // stride
        outputs[f"box{stride}"] = RANDOM.normal(0, 1, (1, 64, rows, columns)).astype(np.float32)
        outputs[f"cls{stride}"] = RANDOM.uniform(-9, -3, (1, 80, rows, columns)).astype(np.float32)
        outputs[f"coef{stride}"] = np.zeros((1, 32, rows, columns), np.float32)
    for i, (cls, score, x, y, bw, bh) in enumerate(OBJECTS):
        stride = (16, 8, 16, 32, 16, 8, 16)[i]
        column, row = min(w // stride - 1, x // stride), min(h // stride - 1, max(0, y // stride))
        logit = np.float32(np.log(score / (1 - score)))
        outputs[f"cls{stride}"][0, cls, row, column] = logit
        outputs[f"coef{stride}"][0, :, row, column] = coefficients[i]
        sides = []
        for side, wanted in enumerate(corners(x, y, bw, bh)):
            centre = ((column, row)[side % 2] + 0.5) * stride
            distance = np.clip((centre - wanted if side < 2 else wanted - centre) / stride, 0.3, 14)
            bins = -3.0 * (np.arange(16) - distance) ** 2 + RANDOM.normal(0, 0.1, 16)
            bins = bins.astype(np.float32)
            outputs[f"box{stride}"][0, 16 * side:16 * side + 16, row, column] = bins
            share = np.exp(bins.astype(np.float64) - bins.max())
            length = (share * np.arange(16)).sum() / share.sum() * stride
            sides.append(centre - length if side < 2 else centre + length)
        if score >= 0.25:
            candidates.append((cls, float(sigmoid(logit)), tuple(sides), coefficients[i]))
    constant_graph("yolo_seg_headless", outputs)
    expect("yolo_seg_headless", masked(place, candidates, protos))


def fastest_det():
    size, rows, columns = (96, 64), 4, 6
    out = np.zeros((1, 85, rows, columns), np.float32)
    out[0, 0] = 0.2
    out[0, 5:] = RANDOM.uniform(0, 0.3, (80, rows, columns))
    place, candidates = Placement("stretch", size), []
    for cls, objectness, share, x, y, w, h in [(0, 0.9, 0.95, 1.4, 1.7, 0.3, 0.6), (0, 0.8, 0.9, 4.6, 2.2, 0.4, 0.9),
                                               (62, 0.95, 0.7, 3.2, 0.4, 0.2, 0.2), (0, 0.85, 0.9, 2.1, 1.9, 0.3, 0.6),
                                               (5, 0.3, 0.9, 5.5, 3.5, 0.2, 0.2)]:
        column, row = int(x), int(y)
        cell = np.array([objectness, np.arctanh(x - column), np.arctanh(y - row), np.log(w / (1 - w)), np.log(h / (1 - h))],
                        np.float32)
        out[0, :5, row, column], out[0, 5 + cls, row, column] = cell, share
        cell = cell.astype(np.float64)
        score = cell[0] ** 0.6 * float(np.float32(share)) ** 0.4
        if score >= 0.6:
            box = corners((column + np.tanh(cell[1])) / columns * size[0], (row + np.tanh(cell[2])) / rows * size[1],
                          sigmoid(cell[3]) * size[0], sigmoid(cell[4]) * size[1])
            candidates.append((cls, score, box))
    constant_graph("fastestdet", {"758": out}, size)
    expect("fastestdet", [(c[0], c[1], place.box(*c[2]), None) for c in suppress(candidates)])


def conventions():
    """Score of class k = mean of channel k as the network sees it."""
    weights = np.zeros((84 * 84, 3))
    out = np.zeros((1, 84, 84), np.float32)
    out[0, :4, 5] = [32, 32, 64, 64]
    for k in range(3):
        weights[(4 + k) * 84 + 5, k] = 1
    constant_graph("channels_yolo", {"output0": out}, by_channel={"output0": weights})
    weights = np.zeros((80, 3))
    weights[:3] = np.eye(3) / 255
    masks = np.ones((1, 1, 64, 64), np.float32)
    constant_graph("channels_sparseinst", {"scores": np.zeros((1, 1, 80), np.float32), "masks": masks},
                   by_channel={"scores": weights})
    out = np.zeros((1, 85, 4, 4), np.float32)
    out[0, 0, 1, 1] = 1
    weights = np.zeros((85 * 16, 3))
    for k in range(3):
        weights[(5 + k) * 16 + 5, k] = 1
    constant_graph("channels_fastestdet", {"758": out}, by_channel={"758": weights})


def bad_ones():
    out = np.zeros((1, 84, 84), np.float32)
    out[0, 7, 3] = np.nan
    constant_graph("nan", {"output0": out})
    constant_graph("gray", {"output0": np.zeros((1, 84, 84), np.float32)}, channels=1)
    constant_graph("open", {"output0": np.zeros((1, 84, 2100), np.float32)}, open_size=True)
    constant_graph("three_classes", {"output0": np.zeros((1, 7, 84), np.float32)})
    constant_graph("unknown", {"logits": np.zeros((1, 1000), np.float32)})
    # Objects side by side everywhere, all over the threshold.
    n = 84 * 64
    many = np.zeros((1, 84, n), np.float32)
    many[0, 0], many[0, 1] = (np.arange(n) % 64) * 8 + 4, (np.arange(n) // 64) * 6 + 3
    many[0, 2:4] = 4
    many[0, 4] = RANDOM.uniform(0.5, 0.99, n)
    constant_graph("many", {"output0": many}, (512, 512))
    boxes = np.zeros((1, 84, 84), np.float32)
    boxes[0, 4] = 0.9
    boxes[0, :4, 1:] = np.array([[np.inf], [3e30], [-5], [0]])
    boxes[0, :4, 0] = [30, 30, 1e30, 1e30]
    constant_graph("wild_boxes", {"output0": boxes})
    two = [helper.make_node("Add", ["a", "b"], ["c"])]
    save("two_inputs", two, [], [("a", [1, 3, 64, 64]), ("b", [1, 3, 64, 64])], [("c", [1, 3, 64, 64])])
    save("unknown_operation",
         [helper.make_node("Einsum", ["images", "images"], ["c"], equation="bchw,bchw->bc")], [],
         [("images", [1, 3, 64, 64])], [("c", [1, 3])], opset=12)


def open_sizes():
    """FastestDet-like, one object in the middle of each cell; the outputs follow the input. What is fixed is fixed
    in a Reshape, as exports have it: no other size runs, or none that is decoded."""
    for name, (width, height) in {"open_height": (640, 0), "open_width": (0, 480), "open_both": (0, 0)}.items():
        bias = np.zeros(85, np.float32)
        bias[0], bias[5] = 0.9, 0.9
        nodes = [helper.make_node("Conv", ["images", "w", "b"], ["conv"], kernel_shape=[16, 16], strides=[16, 16])]
        weights = [numpy_helper.from_array(np.zeros((85, 3, 16, 16), np.float32), "w"),
                   numpy_helper.from_array(bias, "b")]
        if width or height:
            shape = np.array([1, 85, height // 16 or -1, width // 16 or -1], np.int64)
            weights.append(numpy_helper.from_array(shape, "s"))
            nodes.append(helper.make_node("Reshape", ["conv", "s"], ["758"]))
        else:
            nodes[0].output[0] = "758"
        save(name, nodes, weights, [("images", [1, 3, height or "height", width or "width"])],
             [("758", [1, 85, height // 16 or "rows", width // 16 or "columns"])])


def unrunnable():
    """The end of a standard YOLOv8 export: OpenCV 4.6 reads it but cannot run it."""
    a = 64
    node, array = helper.make_node, numpy_helper.from_array
    nodes = [node("Conv", ["images", "w"], ["c"], kernel_shape=[8, 8], strides=[8, 8]),
             node("Reshape", ["c", "s1"], ["r"]),
             node("Split", ["r"], ["box", "cls"], axis=1, split=[64, 80]),
             node("Reshape", ["box", "s2"], ["b4"]), node("Transpose", ["b4"], ["bt"], perm=[0, 2, 1, 3]),
             node("Softmax", ["bt"], ["sm"], axis=1), node("Conv", ["sm", "wd"], ["d"], kernel_shape=[1, 1]),
             node("Reshape", ["d", "s3"], ["d4"]), node("Slice", ["d4", "i0", "i2", "ax"], ["lt"]),
             node("Slice", ["d4", "i2", "i4", "ax"], ["rb"]), node("Sub", ["anchors", "lt"], ["x1"]),
             node("Add", ["anchors", "rb"], ["x2"]), node("Add", ["x1", "x2"], ["sum"]),
             node("Div", ["sum", "two"], ["centre"]), node("Sub", ["x2", "x1"], ["size"]),
             node("Concat", ["centre", "size"], ["bx"], axis=1), node("Mul", ["bx", "strides"], ["bs"]),
             node("Sigmoid", ["cls"], ["cs"]), node("Concat", ["bs", "cs"], ["output0"], axis=1)]
    weights = [array(np.zeros((144, 3, 8, 8), np.float32), "w"), array(np.array([1, 144, a]), "s1"),
               array(np.array([1, 4, 16, a]), "s2"), array(np.array([1, 4, a]), "s3"),
               array(np.arange(16, dtype=np.float32).reshape(1, 16, 1, 1), "wd"), array(np.array([0]), "i0"),
               array(np.array([2]), "i2"), array(np.array([4]), "i4"), array(np.array([1]), "ax"),
               array(np.ones((1, 2, a), np.float32), "anchors"), array(np.array(2, np.float32), "two"),
               array(np.full((1, a), 8, np.float32), "strides")]
    save("unrunnable", nodes, weights, [("images", [1, 3, 64, 64])], [("output0", [1, 84, a])])


os.makedirs(OUT, exist_ok=True)
for make in (sparse_inst, mask_rcnn, yolo, headless, fastest_det, conventions, bad_ones, open_sizes, unrunnable):
    make()
