// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "processor.h"
#include "util/scratch_file.h"

namespace pmsp {

/// Array of a keyframe that waits for others: in the memory of a processor or, with a scratch file, spilled to it.
template <class Processor, class T>
class Spillable {
 public:
  /// `on` and `scratch` must outlive it. `scratch`: nullptr = in memory.
  Spillable(Processor& on, ScratchFile* scratch) : on_(on), scratch_(scratch) {}
  ~Spillable() { reset(); }
  Spillable(const Spillable&) = delete;
  Spillable& operator=(const Spillable&) = delete;

  /// `room`: maximum `count`, the same in each call.
  void put(Array<T> array, std::size_t count, std::size_t room) {
    count_ = count;
    copies_.clear();
    ready_ = on_.mark();
    if (scratch_ == nullptr) {
      array_ = std::move(array);
      return;
    }
    if (count == 0) return;
    if (room_ == 0) begin_ = scratch_->take(room * sizeof(T));
    room_ = room;
    on_.save(array, count, *scratch_, begin_);
  }
  void put(Array<T> array, std::size_t count) { put(std::move(array), count, count); }

  /// Returns the array, or a copy of it.
  Array<T> get() const {
    if (room_ == 0 || count_ == 0) return array_;
    return on_.template load<T>(count_, *scratch_, begin_);
  }
  /// Returns the array on any processor of the engine: on another one as a copy, made once.
  Array<T> get(Processor& reader) const {
    if (&reader == &on_) return get();
    if (count_ == 0) return nullptr;
    if (room_ > 0) return reader.template load<T>(count_, *scratch_, begin_);
    for (const auto& [holder, copy] : copies_) {
      if (holder == &reader) return copy;
    }
    return copies_.emplace_back(&reader, reader.copy_from(array_, count_, on_, ready_)).second;
  }
  std::size_t count() const { return count_; }

  /// Memory, without the scratch file [bytes].
  std::size_t bytes() const { return ((array_ ? 1 : 0) + copies_.size()) * count_ * sizeof(T); }

  void reset() {
    array_.reset();
    copies_.clear();
    if (room_ > 0) scratch_->give_back(begin_, room_ * sizeof(T));
    room_ = 0;
    count_ = 0;
  }

 private:
  Processor& on_;
  ScratchFile* scratch_;
  Array<T> array_;
  typename Processor::ReadyEvent ready_{};  ///< when the array is complete
  mutable std::vector<std::pair<const Processor*, Array<T>>> copies_;
  std::size_t count_ = 0;
  std::size_t room_ = 0;  ///< elements in the scratch file; 0 = none
  std::uint64_t begin_ = 0;
};

}  // namespace pmsp
