// A checkpoint that all ranks write together.
#pragma once

#include <concepts>
#include <optional>
#include <string>
#include <utility>

#include <pliant/base/ranks.h>
#include <pliant/io/checkpoint.h>

namespace pliant {

/// The root's writer, where it is there. All functions are collective.
class SharedCheckpoint {
 public:
  SharedCheckpoint(CheckpointWriter* writer, const Ranks& ranks) : writer_(writer), ranks_(ranks) {}

  /// Data of each rank, one rank after the other: in the order of StoredParticles.
  template <class Values>
  void add_parts(const std::string& name, Values&& own) {
    const auto all = ranks_.gather(std::forward<Values>(own));
    ranks_.on_root([&] { writer_->add(name, all); });
  }
  /// Data equal on every rank, or of the root: a number or an array.
  template <class Value>
  void add(const std::string& name, const Value& value) {
    ranks_.on_root([&] { writer_->add(name, value); });
  }
  void add_text(const std::string& name, const std::string& text) {
    ranks_.on_root([&] { writer_->add_text(name, text); });
  }

 private:
  CheckpointWriter* writer_;
  const Ranks& ranks_;
};

}  // namespace pliant
