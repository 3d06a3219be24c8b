// SPDX-License-Identifier: BSD-2-Clause
#include "json_input.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <unordered_set>
#include <vector>

#include "binary_input.h"

namespace pmsp {
namespace {

using nlohmann::json;

constexpr int kMaxNesting = 64;

/// Characters of a file, with null instead of NaN, Infinity and -Infinity outside of strings.
class JsonCharacters {
 public:
  explicit JsonCharacters(BinaryInput& in) : in_(in) { replace_word(); }

  bool at_end() const { return at_ == word_.size() && in_.remaining() == 0; }
  char peek() const { return at_ < word_.size() ? word_[at_] : static_cast<char>(in_.peek()); }
  void advance() {
    if (at_ < word_.size()) {
      if (++at_ < word_.size()) return;
    } else {
      const int c = in_.get();
      if (in_.position() - token_ > kLongestToken) {
        in_.refuse("a string or blanks of more than a mebibyte, expected no such thing in JSON");
      }
      if (c == '"' && !is_escaped_) is_text_ = !is_text_;
      is_escaped_ = is_text_ && c == '\\' && !is_escaped_;
    }
    replace_word();
  }
  /// To be called after each token of the parser.
  void token_seen() { token_ = in_.position(); }

 private:
  /// Reads a word that may be one of those into `word_`, which is read instead.
  void replace_word() {
    const int first = is_text_ ? -1 : in_.peek();
    if (first != 'N' && first != 'I' && first != '-') return;
    word_.clear();
    at_ = 0;
    do word_ += static_cast<char>(in_.get());
    while (is_letter(in_.peek()) && word_.size() < kLongest);
    if (word_ == "NaN" || word_ == "-NaN" || word_ == "Infinity" || word_ == "-Infinity") word_ = "null";
  }

  static bool is_letter(int c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

  static constexpr std::size_t kLongest = 10;  ///< characters of these words
  static constexpr std::uint64_t kLongestToken = std::uint64_t{1} << 20;

  BinaryInput& in_;
  std::uint64_t token_ = 0;  ///< end of the last one
  std::string word_;
  std::size_t at_ = 0;  ///< in `word_`
  bool is_text_ = false;
  bool is_escaped_ = false;
};

/// Input iterator over these for the parser; the end if `characters` is null.
class JsonIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = char;

  explicit JsonIterator(JsonCharacters* characters = nullptr) : characters_(characters) {}

  char operator*() const { return characters_->peek(); }
  JsonIterator& operator++() {
    characters_->advance();
    return *this;
  }
  bool operator==(const JsonIterator& other) const { return is_done() == other.is_done(); }
  bool operator!=(const JsonIterator& other) const { return !(*this == other); }

 private:
  bool is_done() const { return characters_ == nullptr || characters_->at_end(); }

  JsonCharacters* characters_;
};

/// Checks each token of the parser.
class Guard {
 public:
  Guard(const BinaryInput& in, JsonCharacters& characters) : in_(in), characters_(characters) {}

  bool operator()(int depth, json::parse_event_t event, json& value) {
    characters_.token_seen();
    if (depth > kMaxNesting) {
      in_.refuse("values nested " + std::to_string(depth) + " deep, expected " + std::to_string(kMaxNesting));
    }
    if (event == json::parse_event_t::object_start) keys_.emplace_back();
    if (event == json::parse_event_t::object_end) keys_.pop_back();
    if (event == json::parse_event_t::key && !keys_.back().insert(value.get_ref<const std::string&>()).second) {
      in_.refuse("the key " + in_quotes(value.get_ref<const std::string&>()) + " appears twice in one object");
    }
    return true;
  }

 private:
  const BinaryInput& in_;
  JsonCharacters& characters_;
  std::vector<std::unordered_set<std::string>> keys_;  ///< of the objects that are open
};

json parse(BinaryInput& in) {
  JsonCharacters characters(in);
  Guard guard(in, characters);
  try {
    return json::parse(JsonIterator(&characters), JsonIterator(), std::ref(guard));
  } catch (const json::exception& error) {
    in.refuse(in.remaining() == 0 ? "the file ends before the JSON text is complete: it is truncated; copy it again"
                                  : std::string("broken JSON (") + error.what() + ")");
  }
}

}  // namespace

json read_json(const std::filesystem::path& path) {
  BinaryInput in(path);
  return parse(in);
}

json parse_json(const std::string& text, const std::filesystem::path& name) {
  BinaryInput in(name, text);
  return parse(in);
}

void JsonValue::refuse(const std::string& expected) const {
  std::string found = json_->type_name();
  if (json_->is_number()) found = to_message(json_->get<double>());
  if (json_->is_string()) found = in_quotes(json_->get_ref<const std::string&>());
  if (json_->is_array()) found = "an array of " + std::to_string(json_->size());
  fail(*path_, where_, "is " + found + ", expected " + expected);
}

std::string JsonValue::member_name(const std::string& key) const {
  const bool plain = !key.empty() && std::all_of(key.begin(), key.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
  if (!plain) return where_ + "[" + in_quotes(key) + "]";
  return where_.empty() ? key : where_ + "." + key;
}

JsonValue JsonValue::at(const char* key) const {
  if (!json_->is_object()) refuse("an object");
  const auto found = json_->find(key);
  if (found == json_->end()) fail(*path_, where_, std::string("lacks \"") + key + "\"");
  return {*found, *path_, member_name(key)};
}

JsonValue JsonValue::element(std::size_t index) const {
  if (!json_->is_array() || index >= json_->size()) refuse("an array of more than " + std::to_string(index));
  return {(*json_)[index], *path_, where_ + "[" + std::to_string(index) + "]"};
}

double JsonValue::number() const {
  if (!json_->is_number() || !std::isfinite(json_->get<double>())) refuse("a finite number");
  return json_->get<double>();
}

double JsonValue::number_or_nan() const { return json_->is_null() ? std::nan("") : number(); }

std::int64_t JsonValue::integer() const {
  if (json_->is_number_unsigned() && json_->get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX)) {
    refuse("a whole number below 2^63");
  }
  if (json_->is_number_integer()) return json_->get<std::int64_t>();
  const double value = number();  // "1920.0" is what some programs write
  if (value != std::floor(value) || std::abs(value) > 1e15) refuse("a whole number");
  return static_cast<std::int64_t>(value);
}

const std::string& JsonValue::text() const {
  if (!json_->is_string()) refuse("a string");
  return json_->get_ref<const std::string&>();
}

const json& JsonValue::array_of(std::size_t size, const char* expected) const {
  if (!json_->is_array() || json_->size() != size) refuse(expected);
  return *json_;
}

Eigen::Vector3d JsonValue::vector3() const {
  array_of(3, "an array of 3 numbers");
  return {element(0).number_or_nan(), element(1).number_or_nan(), element(2).number_or_nan()};
}

Eigen::Matrix3d JsonValue::matrix3() const {
  array_of(3, "an array of 3 rows of 3 numbers");
  Eigen::Matrix3d matrix;
  for (std::size_t i = 0; i < 3; ++i) matrix.row(static_cast<Eigen::Index>(i)) = element(i).vector3().transpose();
  return matrix;
}

Eigen::Matrix4d JsonValue::matrix4() const {
  if (!json_->is_array() || (json_->size() != 3 && json_->size() != 4)) refuse("an array of 3 or 4 rows of 4 numbers");
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (std::size_t i = 0; i < json_->size(); ++i) {
    const JsonValue row = element(i);
    row.array_of(4, "an array of 4 numbers");
    for (std::size_t k = 0; k < 4; ++k) {
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = row.element(k).number_or_nan();
    }
  }
  if (matrix.allFinite() && !matrix.row(3).isApprox(Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0))) {
    fail(*path_, where_, "has another last row than 0 0 0 1, expected a rotation and a translation");
  }
  return matrix;
}

}  // namespace pmsp
