# SPDX-License-Identifier: BSD-2-Clause
"""The type stubs say what the module has, and mypy finds nothing wrong with either."""

import ast
import inspect
import pathlib
import re
import subprocess
import sys

import pytest
import stillpoint

PACKAGE = pathlib.Path(stillpoint.__file__).parent
# Python calls these, and the stubs leave them to object.
IMPLIED = {
    *("__repr__", "__hash__", "__doc__", "__module__", "__init__", "__new__", "__weakref__"),
    "__reduce_ex__",
}


def stubs():
    """All classes and functions of the stubs, by name."""
    found = {}
    for file in sorted((PACKAGE / "_types").glob("*.pyi")):
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                found.setdefault(node.name, node)
    return found


def stub_arguments(node):
    """Names of a stub's arguments with their defaults; * and **kwargs by their mark."""
    a = node.args
    positional = [*a.posonlyargs, *a.args]
    first_default = len(positional) - len(a.defaults)
    result = []
    for i, argument in enumerate(positional):
        default = a.defaults[i - first_default] if i >= first_default else None
        result.append((argument.arg, default and ast.unparse(default)))
    if a.kwonlyargs:
        result.append(("*", None))
    for argument, default in zip(a.kwonlyargs, a.kw_defaults):
        result.append((argument.arg, default and ast.unparse(default)))
    return result + ([("**", None)] if a.kwarg else [])


def real_arguments(function):
    """The same of the module's own function, from the signature that pybind11 writes."""
    text = function.__doc__.splitlines()[0]
    inside = text[text.index("(") + 1 : text.rindex(")")]
    result = []
    for part in re.split(r", (?=[\w*]+(?:: |$|,)|\*)", inside) if inside else []:
        name, _, rest = part.partition(": ")
        if name.startswith("**"):
            result.append(("**", None))
        elif name == "*":
            result.append(("*", None))
        else:
            _, has_default, default = rest.partition(" = ")
            result.append((name, default if has_default else None))
    return result


def check(name, node, function):
    real, written = real_arguments(function), stub_arguments(node)
    if real and re.match(r"arg\d", real[0][0]):
        real[0] = ("self", None)
    real = [("self" if n == "arg0" else n, d) for n, d in real]
    if any(n == "**" for n, _ in real) and not any(n == "**" for n, _ in written):
        real, written = real[:-1], written[: len(real) - 1]  # the stub names them one by one
    assert [n for n, _ in written] == [n for n, _ in real], name
    for (argument, default), (_, real_default) in zip(written, real):
        same = default == real_default or (default and default in ("...",))
        assert same, f"{name}({argument}): the stub has {default}, the module {real_default}"


def test_every_name_of_the_module_has_a_stub_and_the_other_way_round():
    public = {n for n in stubs() if not n.startswith("_")}
    assert public | {"FrameStatus", "KeypointReason"} == set(stillpoint.__all__)
    exported = set(re.findall(r"import \(?\s*(\w+) as \1", (PACKAGE / "__init__.pyi").read_text()))
    assert exported == set(stillpoint.__all__)


@pytest.mark.parametrize("name", sorted(n for n in stubs() if not n.startswith("_")))
def test_a_stub_has_the_signature_of_the_module(name):
    node, real = stubs()[name], getattr(stillpoint, name)
    if isinstance(node, ast.FunctionDef):
        if not node.decorator_list:
            check(name, node, real)
        return
    members = {}
    bases = [stubs()[b.id] for b in node.bases if isinstance(b, ast.Name) and b.id in stubs()]
    for body in (*bases, node):
        for item in body.body:
            if isinstance(item, ast.FunctionDef):
                members[item.name] = item
            elif isinstance(item, ast.AnnAssign):
                members[item.target.id] = item
    for member, item in members.items():
        found = inspect.getattr_static(real, member)
        decorators = {ast.unparse(d) for d in getattr(item, "decorator_list", [])}
        if isinstance(item, ast.AnnAssign) or f"{member}.setter" in decorators:
            assert found.fset is not None, f"{name}.{member} is read-only"
        elif "property" in decorators:
            assert isinstance(found, property) and found.fset is None, f"{name}.{member}"
        elif not member.startswith("__") or member == "__init__":
            check(f"{name}.{member}", item, getattr(real, member))
    own = {m for m in vars(real) if m not in IMPLIED and not m.startswith("_pybind")}
    assert own <= set(members), f"{name}: {own - set(members)} are not in the stub"


def test_everything_has_a_docstring():
    for name in stillpoint.__all__:
        value = getattr(stillpoint, name)
        assert (value.__doc__ or "").strip(), name
        if inspect.isclass(value):
            for member, item in vars(value).items():
                if callable(item) and not member.startswith("_"):
                    lines = (item.__doc__ or "").strip().splitlines()
                    assert len(lines) > 1 or not lines[0].startswith(member), f"{name}.{member}"


def mypy(*arguments, path):
    return subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", path / "cache", *arguments],
        capture_output=True,
        text=True,
        env={"MYPYPATH": str(PACKAGE.parent), "PATH": "/usr/bin:/bin"},
    )


USE = """
import numpy as np
import stillpoint
from numpy.typing import NDArray

class Mine(stillpoint.Segmenter):
    def segment(self, frame: stillpoint.RgbdFrame) -> NDArray[np.uint8]:
        return frame.color[..., 0]

camera = stillpoint.Camera(525, 525, 319.5, 239.5, k1=0.1, depth_units_per_m=1000)
front_end = stillpoint.FrontEnd(camera, Mine(), use_motion=False)
for frame in stillpoint.SyntheticSequence(frames=2):
    mask: NDArray[np.uint8] = front_end.compute_mask(frame.rgbd())
    kept = stillpoint.compact([1, 2], front_end.select([[1, 2], [3, 4]]))
    kept.append(3)
    if front_end.stats.status & stillpoint.FrameStatus.NO_DEPTH:
        print(front_end.stats.mask_age_s)
"""


def test_mypy_takes_the_stubs_and_a_program(tmp_path):
    pytest.importorskip("mypy")
    result = mypy("-p", "stillpoint", path=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    (tmp_path / "use.py").write_text(USE)
    result = mypy(tmp_path / "use.py", path=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    (tmp_path / "misuse.py").write_text(USE + "\nfront_end.select(keypoint=3)\n")
    result = mypy(tmp_path / "misuse.py", path=tmp_path)
    assert result.returncode == 1 and "keypoint" in result.stdout
