// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "machine.h"
#include "option_table.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"

using namespace pmsp;

namespace {

/// Error for a value given as text; empty if valid.
std::string complaint(const OptionEntry& entry, const std::string& text) {
  DensifierOptions options;
  try {
    entry.set(options, text, "here");
    entry.check(options);
  } catch (const InvalidOption& error) {
    return error.what();
  }
  return "";
}

/// Error of `check` for a number stored directly in the field.
std::string complaint_of_check(const OptionEntry& entry, double value) {
  DensifierOptions options;
  if (const auto* number = std::get_if<double& (*)(DensifierOptions&)>(&entry.access)) (*number)(options) = value;
  if (const auto* whole = std::get_if<int& (*)(DensifierOptions&)>(&entry.access)) {
    (*whole)(options) = static_cast<int>(value);
  }
  try {
    entry.check(options);
  } catch (const InvalidOption& error) {
    return error.what();
  }
  return "";
}

bool is_whole(const OptionEntry& entry) { return std::holds_alternative<int& (*)(DensifierOptions&)>(entry.access); }
bool is_number(const OptionEntry& entry) {
  return is_whole(entry) || std::holds_alternative<double& (*)(DensifierOptions&)>(entry.access);
}

std::string number(double value) {
  std::ostringstream text;
  text.precision(17);
  text << value;
  return text.str();
}

/// A field of options.h: its key and its comment.
struct Documented {
  std::string key, comment;
};

std::vector<Documented> documented() {
  const std::vector<std::pair<std::string, std::string>> kStages{{"ViewFilterOptions", "view_filter."},
                                                                 {"InitOptions", "init."},
                                                                 {"PatchMatchOptions", "patchmatch."},
                                                                 {"MedianFilterOptions", "median."},
                                                                 {"ConsistencyFilterOptions", "consistency."},
                                                                 {"FusionOptions", "fusion."},
                                                                 {"FreeSpaceOptions", "free_space."},
                                                                 {"AdvancedOptions", ""},
                                                                 {"DensifierOptions", ""}};
  std::stringstream file;
  for (const char* name : {"/advanced.h", "/options.h"})
    file << std::ifstream(PMSP_HEADERS + std::string(name)).rdbuf();
  std::vector<Documented> fields;
  std::string prefix, before;
  bool inside = false, follows = false;
  const std::regex kTile(R"(^  (?:bool|int|double|Simd|Backend|std::\S+) (\w+) = [^;]*;(?:\s*///<(.*))?$)");
  for (std::string line; std::getline(file, line);) {
    std::smatch match;
    if (line.rfind("struct ", 0) == 0) {
      const std::string name = line.substr(0, line.rfind(" {")).substr(line.rfind(' ', line.rfind(" {") - 1) + 1);
      for (const auto& [stage, key] : kStages) {
        if (name == stage) prefix = key, inside = true;
      }
    } else if (line.rfind("};", 0) == 0) {
      inside = false;
    } else if (inside && std::regex_match(line, match, kTile)) {
      fields.push_back({prefix + match[1].str(), before + match[2].str()});
      before.clear();
      follows = match[2].matched;
    } else if (inside && follows && line.find("///<") != std::string::npos) {  // a comment's next line
      fields.back().comment += line.substr(line.find("///<") + 4);
    } else {
      const std::size_t comment = line.find("///");
      before = comment == std::string::npos ? "" : before + line.substr(comment + 3);
      follows = false;
    }
  }
  return fields;
}

}  // namespace

TEST_CASE("every field of the options is in the table and its comment states the table's range", "[options]") {
  std::set<std::string> keys;
  for (const Documented& field : documented()) {
    const std::string key = field.key == "devices" ? "device" : field.key;
    INFO(key << ":" << field.comment);
    if (key == "expected_keyframes") continue;  // an input of the caller, not a choice
    keys.insert(key);
    const OptionEntry* entry = find_option(key);
    REQUIRE(entry != nullptr);
    if (!is_number(*entry)) continue;
    const auto end = [](double value) {
      std::ostringstream text;  // shorter than to_string: 0.1, 1e+12
      text << value;
      return std::abs(value) < 1e9 ? text.str() : std::string(value < 0 ? "-" : "") + "1e12";
    };
    const std::string range = end(entry->min) + " to " + end(entry->max);
    CHECK_THAT(field.comment, Catch::Contains(range));
  }
  CHECK(keys.size() == option_table().size());
  for (const OptionEntry& entry : option_table()) {
    INFO(entry.key);
    CHECK(keys.count(entry.key) == 1);
  }
}

TEST_CASE("each option's bounds are valid and values beyond are refused by name", "[options]") {
  for (const OptionEntry& entry : option_table()) {
    if (!is_number(entry)) continue;
    INFO(entry.key);
    const bool any = entry.numbers == OptionEntry::Numbers::kAll;
    const double step = is_whole(entry) ? (any ? 1.0 : 2.0) : 0.01 * std::max(1.0, std::abs(entry.max));
    for (const double good : {entry.min, entry.max}) {
      CHECK(complaint(entry, number(good)) == "");
      CHECK(complaint_of_check(entry, good) == "");
    }
    for (const double bad : {entry.min - step, entry.max + step}) {
      if (bad == 0.0 && entry.allows_zero) continue;
      CHECK_THAT(complaint(entry, number(bad)), Catch::Contains("here is ") && Catch::Contains("expected"));
      CHECK_THAT(complaint_of_check(entry, bad), Catch::Contains(entry.key) && Catch::Contains("expected"));
    }
    if (!any) CHECK_THAT(complaint(entry, number(entry.min + 1.0)), Catch::Contains("even") || Catch::Contains("odd"));
    CHECK((complaint(entry, "0") == "") == (entry.allows_zero || (entry.min <= 0.0 && entry.max >= 0.0)));
    for (const char* none : {"", "three", "1x", "--1"}) CHECK_THAT(complaint(entry, none), Catch::Contains("expected"));
    if (is_whole(entry)) {
      CHECK_THAT(complaint(entry, "2.5"), Catch::Contains("number"));
      continue;
    }
    CHECK_THAT(complaint_of_check(entry, std::numeric_limits<double>::quiet_NaN()), Catch::Contains(entry.key));
    CHECK_THAT(complaint_of_check(entry, std::numeric_limits<double>::infinity()), Catch::Contains(entry.key));
    CHECK_THAT(complaint(entry, "nan"), Catch::Contains("expected"));
  }
}

TEST_CASE("all options are checked at any nesting", "[options]") {
  for (const OptionEntry& entry : option_table()) {
    if (!is_number(entry)) continue;
    INFO(entry.key);
    DensifierOptions options;
    std::visit(
        [&](auto at) {
          using T = std::decay_t<decltype(at(options))>;
          if constexpr (std::is_same_v<T, int> || std::is_same_v<T, double>) at(options) = static_cast<T>(2e9);
        },
        entry.access);
    if (entry.max >= 2e9) continue;
    CHECK_THROWS_WITH(options.validate(), Catch::Contains(entry.key));
  }
  DensifierOptions options;
  options.devices.assign(17, 0);
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("device") && Catch::Contains("16 at most"));
  options.devices = {256};
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("device is 256"));
}

TEST_CASE("an option's printed value can be parsed", "[options]") {
  for (const Quality quality : {Quality::kPaper, Quality::kOnline, Quality::kNormal, Quality::kHigh}) {
    const DensifierOptions from = preset(quality);
    DensifierOptions to;
    for (const OptionEntry& entry : option_table()) entry.set(to, entry.text_of(from), "here");
    for (const OptionEntry& entry : option_table()) {
      INFO(entry.key);
      CHECK(entry.text_of(to) == entry.text_of(from));
    }
  }
  DensifierOptions options;
  find_option("device")->set(options, "all", "here");
  CHECK(options.devices.empty());
  find_option("device")->set(options, "0,3", "here");
  CHECK(options.devices == std::vector<int>{0, 3});
  find_option("seed")->set(options, "18446744073709551615", "here");
  CHECK(options.seed == std::numeric_limits<std::uint64_t>::max());
  CHECK_THROWS_WITH(find_option("simd")->set(options, "mmx", "--simd"), Catch::Contains("--simd is \"mmx\""));
  CHECK(find_option("patchmatch") == nullptr);
}

TEST_CASE("sizes are even, or 0 for automatic", "[options]") {
  DensifierOptions options;
  options.width = 641;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("width") && Catch::Contains("641") && Catch::Contains("even"));
  options.width = 0;
  options.height = 161;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("height") && Catch::Contains("161"));
  options.height = 0;
  CHECK_NOTHROW(options.validate());
}

TEST_CASE("windows are odd and symmetric around the keyframe", "[options]") {
  for (const int window : {4, 14}) {
    DensifierOptions options;
    options.advanced.consistency.window = window;
    CHECK_THROWS_WITH(options.validate(), Catch::Contains("consistency.window") && Catch::Contains("odd"));
    options = {};
    options.advanced.fusion.window = window;
    CHECK_THROWS_WITH(options.validate(), Catch::Contains("fusion.window") && Catch::Contains("odd"));
  }
}

TEST_CASE("the parallax angles must be in order", "[options]") {
  ViewFilterOptions options;
  options.min_parallax_deg = 60.0;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("min_parallax_deg") && Catch::Contains("max_parallax_deg"));
}

TEST_CASE("presets are valid and have the documented values", "[options]") {
  for (const char* name : {"paper", "online", "normal", "high"}) {
    INFO(name);
    CHECK_NOTHROW(preset(quality_from_name(name)).validate());
  }
  const DensifierOptions paper = preset(Quality::kPaper);
  CHECK(paper.width == 640);
  CHECK(paper.height == 320);
  CHECK(paper.advanced.patchmatch.iterations == 4);
  CHECK(paper.advanced.patchmatch.neighbours == 2);
  CHECK(paper.advanced.init.chain_keyframes == 0);
  CHECK(paper.advanced.patchmatch.fine_patch == 1.0);
  CHECK(paper.advanced.consistency.window == 5);
  CHECK(paper.advanced.consistency.min_views == 3);
  CHECK(paper.advanced.consistency.max_relative_depth == 0.08);
  const DensifierOptions online = preset(Quality::kOnline);
  CHECK(online.width == 640);
  CHECK(online.height == 320);
  CHECK(online.advanced.patchmatch.neighbours == 2);
  const DensifierOptions normal = preset(Quality::kNormal);
  CHECK(normal.width == 1440);
  CHECK(normal.height == 720);
  CHECK(normal.advanced.patchmatch.iterations == 2);
  CHECK(normal.advanced.patchmatch.neighbours == 4);
  const DensifierOptions high = preset(Quality::kHigh);
  CHECK(high.width == 0);
  CHECK(high.height == 0);
  CHECK(high.advanced.patchmatch.neighbours == 6);
  CHECK(high.advanced.free_space.whole_mission);
  CHECK_FALSE(paper.advanced.patchmatch.plane_priors);
  CHECK_FALSE(paper.advanced.free_space.enabled);
}

TEST_CASE("automatic sizes are those of the images with small ones enlarged", "[options]") {
  const auto size = [](int image_width, int image_height, int width = 0, int height = 0) {
    DensifierOptions options = preset(Quality::kHigh);
    options.width = width;
    options.height = height;
    fill_in_size(options, image_width, image_height);
    return std::pair(options.width, options.height);
  };
  CHECK(size(1920, 960) == std::pair(1920, 960));
  CHECK(size(7680, 3840) == std::pair(5760, 2880));
  CHECK(size(960, 480) == std::pair(1440, 720));  // no less than `normal` has
  CHECK(size(1280, 640) == std::pair(1440, 720));
  CHECK(size(1440, 720) == std::pair(1440, 720));
  CHECK(size(100, 50) == std::pair(150, 74));
  CHECK(size(960, 480, 320) == std::pair(320, 160));
  CHECK(size(960, 480, 0, 100) == std::pair(200, 100));
}

TEST_CASE("the number of agreeing depth maps is at most that of compared ones", "[options]") {
  ConsistencyFilterOptions options;
  options.min_views = options.window;
  CHECK_NOTHROW(options.validate());
  options.min_views = options.window + 1;
  CHECK_THROWS_WITH(options.validate(), Catch::Contains("consistency.min_views is 6") && Catch::Contains("window, 5"));
}

TEST_CASE("enum names are parsed and unknown ones refused", "[options]") {
  for (const Simd simd : {Simd::kAuto, Simd::kScalar, Simd::kAvx2, Simd::kAvx512})
    CHECK(simd_from_name(name_of(simd)) == simd);
  CHECK(quality_from_name("high") == Quality::kHigh);
  CHECK_THROWS_WITH(simd_from_name("sse"), Catch::Contains("'sse'") && Catch::Contains("avx512"));
  CHECK_THROWS_AS(simd_from_name(""), InvalidOption);
  CHECK(quality_from_name("paper") == Quality::kPaper);
  CHECK_THROWS_WITH(quality_from_name("fast"),
                    Catch::Contains("'fast'") && Catch::Contains("paper") && Catch::Contains("online"));
  CHECK_THROWS_AS(quality_from_name("Online"), InvalidOption);
}

TEST_CASE("an executor resolves threads and instruction set", "[options]") {
  const Executor automatic;
  CHECK(automatic.threads() >= 1);
  CHECK(automatic.simd() == widest_simd());
  CHECK(automatic.simd() != Simd::kAuto);
  const Executor plain(3, Simd::kScalar);
  CHECK(plain.threads() == 3);
  CHECK(plain.simd() == Simd::kScalar);
  CHECK_THROWS_AS(Executor(-1), InvalidOption);
  CHECK_THROWS_AS(Executor(1025), InvalidOption);
}
