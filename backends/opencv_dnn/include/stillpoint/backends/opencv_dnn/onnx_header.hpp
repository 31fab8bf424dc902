// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "stillpoint/core/error.hpp"

namespace stillpoint {

/// What an ONNX file says of its graph's ends. OpenCV does not tell, and says little of a file that
/// it cannot read.
struct OnnxHeader {
  struct Input {
    std::string name;
    /// 0: open.
    std::vector<std::int64_t> shape;
  };
  /// Without the weights, which old files list as inputs, too.
  std::vector<Input> inputs;
  std::vector<std::string> outputs;
};

namespace detail {

/// Reads the fields of a protocol buffer message, one after the other.
class ProtobufReader {
 public:
  ProtobufReader(const char* data, std::size_t size) : at_(data), end_(data + size) {}

  /// Goes to the next field; false at the end. Throws Error if the bytes are no message.
  bool next() {
    if (at_ == end_) return false;
    const std::uint64_t key = varint();
    field_ = static_cast<int>(key >> 3);
    bytes_ = nullptr, size_ = 0, value_ = 0;
    switch (key & 7) {
      case 0:
        value_ = varint();
        break;
      case 1:
        skip(8);
        break;
      case 2: {
        const std::uint64_t length = varint();
        if (length > static_cast<std::uint64_t>(end_ - at_)) throw Error("it ends too early");
        bytes_ = at_, size_ = static_cast<std::size_t>(length);
        at_ += size_;
        break;
      }
      case 5:
        skip(4);
        break;
      default:
        throw Error("it is not in ONNX format");
    }
    if (field_ <= 0) throw Error("it is not in ONNX format");
    return true;
  }
  int field() const { return field_; }
  std::uint64_t value() const { return value_; }
  bool is_message() const { return bytes_ != nullptr; }
  std::string text() const { return bytes_ ? std::string(bytes_, size_) : std::string(); }
  ProtobufReader message() const {
    if (!bytes_) throw Error("it is not in ONNX format");
    return {bytes_, size_};
  }

 private:
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      if (at_ == end_) throw Error("it ends too early");
      const std::uint64_t byte = static_cast<unsigned char>(*at_++);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
    throw Error("it is not in ONNX format");
  }
  void skip(std::ptrdiff_t n) {
    if (n > end_ - at_) throw Error("it ends too early");
    at_ += n;
  }

  const char *at_, *end_;
  const char* bytes_ = nullptr;
  std::size_t size_ = 0;
  std::uint64_t value_ = 0;
  int field_ = 0;
};

// TypeProto: tensor_type (1) { shape (2) { dim (1) { dim_value (1) } } }.
inline void read_onnx_shape(ProtobufReader type, std::vector<std::int64_t>& shape) {
  while (type.next()) {
    if (type.field() != 1) continue;
    for (ProtobufReader tensor = type.message(); tensor.next();) {
      if (tensor.field() != 2) continue;
      for (ProtobufReader dims = tensor.message(); dims.next();) {
        if (dims.field() != 1) continue;
        std::int64_t length = 0;
        for (ProtobufReader dim = dims.message(); dim.next();)
          if (dim.field() == 1) length = static_cast<std::int64_t>(dim.value());
        shape.push_back(length > 0 ? length : 0);
      }
    }
  }
}

}  // namespace detail

/// Reads the header of an ONNX file's bytes. Throws Error (only the reason) if they are none. O(1)
/// in the weights, which are skipped.
inline OnnxHeader read_onnx_header(const char* data, std::size_t size) {
  using detail::ProtobufReader;
  const auto read_value = [](ProtobufReader value) {  // ValueInfoProto: name (1), type (2)
    OnnxHeader::Input input;
    while (value.next()) {
      if (value.field() == 1) input.name = value.text();
      if (value.field() == 2) detail::read_onnx_shape(value.message(), input.shape);
    }
    return input;
  };
  OnnxHeader header;
  std::vector<OnnxHeader::Input> inputs;
  std::set<std::string> weights;
  bool has_graph = false;
  for (ProtobufReader model(data, size); model.next();) {
    if (model.field() != 7 || !model.is_message()) continue;  // ModelProto.graph
    has_graph = true;
    for (ProtobufReader graph = model.message(); graph.next();) {
      if (graph.field() == 5)  // initializer: its name is field 8
        for (ProtobufReader tensor = graph.message(); tensor.next();)
          if (tensor.field() == 8) weights.insert(tensor.text());
      if (graph.field() == 11) inputs.push_back(read_value(graph.message()));
      if (graph.field() == 12) header.outputs.push_back(read_value(graph.message()).name);
    }
  }
  if (!has_graph) throw Error("it has no graph");
  for (OnnxHeader::Input& input : inputs)
    if (weights.count(input.name) == 0) header.inputs.push_back(std::move(input));
  return header;
}

}  // namespace stillpoint
