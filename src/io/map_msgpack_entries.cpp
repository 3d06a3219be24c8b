// SPDX-License-Identifier: BSD-2-Clause
#include "map_msgpack_entries.h"
#include "machine.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "pmsp/stages.h"

namespace pmsp::map_detail {
namespace {

constexpr std::size_t kGroupBytes = std::size_t{1} << 20;
constexpr std::size_t kMostBytes = std::size_t{1} << 26;  // of an entry: no map that a SLAM has made comes near
constexpr int kMostThreads = 16;  // a group each: one more finds where entries end, and is no faster
constexpr char kNil = '\xC0';
constexpr char kMap32 = '\xDF';

/// Big-endian, as MessagePack has it.
void put_count(std::uint32_t count, char* to) {
  for (int byte = 3; byte >= 0; --byte, count >>= 8U) to[byte] = static_cast<char>(count & 0xFFU);
}

void append_map(std::uint32_t count, std::string& to) {
  char bytes[4];
  put_count(count, bytes);
  to += kMap32;
  to.append(bytes, sizeof bytes);
}

/// Copies a string, and returns what it says.
std::string copy_string(ByteSource& source, std::string& to) {
  const std::size_t begin = to.size();
  if (source.at_end()) throw EntryReaders::GaveUp();
  const auto first = static_cast<unsigned char>(source.peek());
  const bool is_short = first >= 0xA0 && first < 0xC0;
  if (!is_short && (first < 0xD9 || first > 0xDB)) throw EntryReaders::GaveUp();
  if (!source.copy_value(to, kMostBytes)) throw EntryReaders::GaveUp();
  const std::size_t head = is_short ? 1 : 1 + (std::size_t{1} << (first - 0xD9U));
  return to.substr(begin + head);
}

template <class T>
void append(std::vector<T>& to, std::vector<T>&& from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

}  // namespace

EntryReaders::Bytes::Bytes(Section section) : bytes("\x81\xA9") {
  bytes.reserve(kGroupBytes + kGroupBytes / 4);
  bytes += name_of(section);
  append_map(0, bytes);
}

void EntryReaders::read(Section section, ByteSource& source) {
  const std::optional<std::uint64_t> count = source.enter_map();
  if (!count) throw GaveUp();
  Bytes group(section);
  for (std::uint64_t i = 0; i < *count; ++i) {
    copy_entry(section, source, group.bytes);
    ++group.entries;
    if (group.bytes.size() >= kGroupBytes) start(std::exchange(group, Bytes(section)));
  }
  start(std::move(group));
  source.put_nil();
}

/// Fields that nobody reads become nil: they are most of the file.
void EntryReaders::copy_entry(Section section, ByteSource& source, std::string& to) {
  copy_string(source, to);
  const std::optional<std::uint64_t> fields = source.enter_map();
  if (!fields || *fields > kMostBytes) throw GaveUp();
  append_map(static_cast<std::uint32_t>(*fields), to);
  for (std::uint64_t i = 0; i < *fields; ++i) {
    if (is_read(section, copy_string(source, to))) {
      if (!source.copy_value(to, kMostBytes)) throw GaveUp();
    } else {
      if (!source.skip_value()) throw GaveUp();
      to += kNil;
    }
  }
}

void EntryReaders::start(Bytes&& group) {
  constexpr std::size_t kCount = 12;  // where the number of entries stands
  put_count(group.entries, &group.bytes[kCount]);
  if (reading_.size() >= static_cast<std::size_t>(std::min(usable_cpus(), kMostThreads))) take_first();
  reading_.push_back(std::async(std::launch::async, read_group, map_.path, std::move(group.bytes)));
}

EntryReaders::Group EntryReaders::read_group(const std::filesystem::path& path, std::string bytes) {
  Group group;
  group.map.path = path;
  ByteSource source(path, bytes);
  bytes = {};
  MapHandler handler(group.map, source);
  using nlohmann::json;
  json::sax_parse(ByteIterator(&source), ByteIterator(), &handler, json::input_format_t::msgpack);
  group.flags = handler.flags();
  return group;
}

void EntryReaders::take_first() {
  Group group = [this] {
    std::future<Group> first = std::move(reading_.front());
    reading_.pop_front();
    return first.get();
  }();
  append(map_.keyframes, std::move(group.map.keyframes));
  append(map_.landmarks, std::move(group.map.landmarks));
  handler_.add(group.flags);
}

void EntryReaders::wait() {
  while (!reading_.empty()) take_first();
}

}  // namespace pmsp::map_detail
