// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <future>
#include <string>

#include "map_byte_source.h"
#include "map_msgpack_handler.h"
#include "map_raw.h"

namespace pmsp::map_detail {

/// Reads the entries of sections by several threads, a group of entries each. To find where entries end takes a
/// fraction of the time that it takes to read them. It expects a sound file: where anything is odd it gives up, and a
/// single thread has to begin anew, which knows what to say.
class EntryReaders {
 public:
  struct GaveUp : std::exception {};

  /// `map` and `handler`: of the file, to which the groups' are added in the order of the file.
  EntryReaders(RawMap& map, MapHandler& handler) : map_(map), handler_(handler) {}

  /// The source stands at the section's value; it will stand at a nil in its place. Throws GaveUp.
  void read(Section section, ByteSource& source);
  /// To be called at the end. Throws GaveUp.
  void wait();

 private:
  struct Group {
    RawMap map;
    MapFlags flags;
  };
  struct Bytes {
    explicit Bytes(Section section);
    std::string bytes;
    std::uint32_t entries = 0;
  };

  static Group read_group(const std::filesystem::path& path, std::string bytes);
  static void copy_entry(Section section, ByteSource& source, std::string& to);
  void start(Bytes&& group);
  void take_first();

  RawMap& map_;
  MapHandler& handler_;
  std::deque<std::future<Group>> reading_;
};

}  // namespace pmsp::map_detail
