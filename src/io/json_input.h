// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace pmsp {

/// Reads a JSON file. NaN, Infinity and -Infinity, which Python writes and JSON lacks, are read as null.
/// Throws IoError; InvalidInput, also if an object contains a key twice.
nlohmann::json read_json(const std::filesystem::path& path);
/// Reads a JSON text; `name` is its path in errors.
nlohmann::json parse_json(const std::string& text, const std::filesystem::path& name);

/// A value of a JSON file and its place, for messages: `shots["1.jpg"].rotation`. All throw InvalidInput if the value
/// is of another kind. Path and JSON must outlive it.
class JsonValue {
 public:
  JsonValue(const nlohmann::json& json, const std::filesystem::path& path, std::string where = "")
      : json_(&json), path_(&path), where_(std::move(where)) {}

  const std::string& where() const { return where_; }
  const std::filesystem::path& path() const { return *path_; }
  [[noreturn]] void refuse(const std::string& expected) const;

  bool is_null() const { return json_->is_null(); }
  bool is_text() const { return json_->is_string(); }
  bool has(const char* key) const { return json_->is_object() && json_->contains(key); }
  JsonValue at(const char* key) const;  ///< member of an object
  JsonValue at(const std::string& key) const { return at(key.c_str()); }
  JsonValue element(std::size_t index) const;  ///< element of an array
  std::size_t size() const { return json_->size(); }

  template <class Visit>
  void each_member(const Visit& visit) const {  ///< visit(const std::string& key, JsonValue)
    if (!json_->is_object()) refuse("an object");
    for (const auto& [key, value] : json_->items()) visit(key, JsonValue(value, *path_, member_name(key)));
  }
  template <class Visit>
  void each_element(const Visit& visit) const {  ///< visit(JsonValue)
    if (!json_->is_array()) refuse("an array");
    for (std::size_t i = 0; i < json_->size(); ++i) visit(element(i));
  }

  double number() const;         ///< finite
  double number_or_nan() const;  ///< NaN for null
  std::int64_t integer() const;  ///< a whole number
  const std::string& text() const;
  Eigen::Vector3d vector3() const;  ///< each number finite or NaN, as below
  Eigen::Matrix3d matrix3() const;  ///< rows
  Eigen::Matrix4d matrix4() const;  ///< rows; a missing fourth one is 0 0 0 1

 private:
  std::string member_name(const std::string& key) const;
  const nlohmann::json& array_of(std::size_t size, const char* expected) const;

  const nlohmann::json* json_;
  const std::filesystem::path* path_;
  std::string where_;
};

}  // namespace pmsp
