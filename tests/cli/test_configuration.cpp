// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <algorithm>
#include <set>
#include <sstream>
#include <utility>

#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "options.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace {

nlohmann::json at(const nlohmann::json& json, const std::string& key) {
  const std::size_t dot = key.find('.');
  return dot == std::string::npos ? json.at(key) : json.at(key.substr(0, dot)).at(key.substr(dot + 1));
}

// A value in the option's range that is not its default.
std::string other_value(const OptionEntry& entry) {
  if (entry.is_switch()) return entry.text_of(preset(Quality::kNormal)) == "true" ? "false" : "true";
  if (std::string(entry.key) == "simd") return "scalar";
  if (std::string(entry.key) == "backend") return "cpu";
  if (std::string(entry.key) == "seed") return "18446744073709551615";
  const double now = std::stod(entry.text_of(preset(Quality::kNormal)));
  const double step = entry.numbers == OptionEntry::Numbers::kAll ? 1.0 : 2.0;
  const double other = now + step <= entry.max ? now + step : 0.5 * (now + entry.min);
  std::string text = std::to_string(other);
  if (text.find(".000000") != std::string::npos) text.resize(text.find('.'));
  return text;
}

}  // namespace

TEST_CASE("one given side of the depth maps determines the other") {
  const TempDir dir;
  const auto sides = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {"config", "--quality", "normal"});
    const auto json = nlohmann::json::parse(densify(words).out);
    return std::pair(json.at("width").get<int>(), json.at("height").get<int>());
  };
  CHECK(sides({}) == std::pair(1440, 720));
  CHECK(sides({"--width", "960"}) == std::pair(960, 0));
  CHECK(sides({"--height", "480"}) == std::pair(0, 480));
  CHECK(sides({"--width", "960", "--height", "500"}) == std::pair(960, 500));
  write_text(dir / "c.json", R"({"width": 800})");
  const std::string file = (dir / "c.json").string();
  CHECK(sides({"--config", file}) == std::pair(800, 0));
  CHECK(sides({"--config", file, "--height", "300"}) == std::pair(0, 300));
}

TEST_CASE("every option is in the help and the configuration and read from flag and file") {
  const TempDir dir;
  std::string help;  // without its line breaks
  std::istringstream words(densify({"run", "--help-all"}).out);
  for (std::string word; words >> word;) help += word + " ";
  const auto defaults = nlohmann::json::parse(densify({"config"}).out);
  for (const OptionEntry& entry : option_table()) {
    INFO(entry.key);
    const std::string flag = tool::flag_of(entry);
    CHECK_THAT(help, Contains(flag + " "));
    CHECK_THAT(help, Contains(entry.help));
    if (entry.is_switch()) CHECK_THAT(help, Contains(tool::negative_flag_of(entry) + " "));
    const std::string value = other_value(entry);
    const Result by_flag = densify({"config", flag + "=" + value});
    REQUIRE(by_flag.code == 0);
    const auto changed = nlohmann::json::parse(by_flag.out);
    CHECK(at(changed, entry.key) != at(defaults, entry.key));
    const bool is_side = entry.key == std::string("width") || entry.key == std::string("height");
    CHECK(nlohmann::json::diff(defaults, changed).size() == (is_side ? 2 : 1));  // the other side follows
    write_text(dir / "c.json", by_flag.out);
    CHECK(densify({"config", "--config", (dir / "c.json").string()}).out == by_flag.out);
  }
}

TEST_CASE("the short help shows the common options and refers to the rest") {
  const auto flags_in = [](const std::string& help) {
    std::set<std::string> flags;
    std::istringstream lines(help);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("  -", 0) != 0) continue;
      const std::string names = line.substr(2, line.find(' ', line.find("--")) - 2);
      if (names.find("--") != std::string::npos) flags.insert(names.substr(names.rfind("--")));
    }
    return flags;
  };
  const std::set<std::string> few = flags_in(densify({"run", "--help"}).out);
  const std::set<std::string> all = flags_in(densify({"run", "--help-all"}).out);
  CHECK(few.size() >= 25);
  CHECK(all.size() > 80);
  const std::string everything = densify({"run", "--help-all"}).out;
  for (const std::string& flag : few) CHECK_THAT(everything, Contains(flag));
  for (const char* flag : {"--images", "--output", "--quality", "--scale", "--up", "--fps", "--stats", "--no-verify"}) {
    INFO(flag);
    CHECK(few.count(flag) == 1);
  }
  CHECK(few.count("--fusion-window") == 0);
  CHECK(all.count("--fusion-window") == 1);
  CHECK(flags_in(densify({"config", "--help"}).out).count("--fusion-window") == 0);
  CHECK(flags_in(densify({"config", "--help-all"}).out).count("--fusion-window") == 1);
  CHECK(densify({"config", "--fusion-window", "3"}).code == 0);  // hidden, but accepted
}

TEST_CASE("the minimum confidence has a short name") {
  const auto json = nlohmann::json::parse(densify({"config", "--min-confidence", "0.5"}).out);
  CHECK(json["fusion"]["min_confidence"] == 0.5);
  CHECK(densify({"config", "--min-confidence", "2"}).code == 2);
}

TEST_CASE("flags override the file and the file overrides the preset") {
  const TempDir dir;
  const std::string file = (dir / "c.json").string();
  write_text(file, R"({"patchmatch": {"iterations": 9}, "fusion": {"window": 7}} // comments are fine)");
  const auto json = nlohmann::json::parse(
      densify({"run", "--print-config", "--quality", "normal", "--config", file, "--fusion-window", "3"}).out);
  CHECK(json["width"] == 1440);
  CHECK(json["patchmatch"]["neighbours"] == 4);
  CHECK(json["patchmatch"]["iterations"] == 9);
  CHECK(json["fusion"]["window"] == 3);
  write_text(file, R"({"quality": "high"})");
  CHECK(nlohmann::json::parse(densify({"config", "--config", file}).out)["patchmatch"]["neighbours"] == 6);
  CHECK(nlohmann::json::parse(densify({"config", "--config", file, "--quality", "online"}).out)["width"] == 640);
}

TEST_CASE("a preset fully overridden by the file gives a warning") {
  const TempDir dir;
  const std::string file = (dir / "c.json").string();
  const std::string high = densify({"config", "--quality", "high"}).out;
  write_text(file, high);
  const Result all = densify({"config", "--config", file, "--quality", "normal"});
  CHECK(all.code == 0);
  CHECK(all.out == high);
  CHECK_THAT(all.err, Contains("warning: --quality normal changes nothing") && Contains(file));
  CHECK(densify({"config", "--config", file}).err.empty());
  const Result run =
      densify(quick_run(dir / "c.ply", {"--config", file, "--quality", "online", "--quiet", "--patchmatch-iterations",
                                        "1", "--patchmatch-neighbours", "2"}));
  CHECK_THAT(run.err, Contains("warning: --quality online changes nothing"));
  write_text(file, R"({"fusion": {"window": 7}})");
  CHECK(densify({"config", "--config", file, "--quality", "normal"}).err.empty());
}

TEST_CASE("the paper preset is a quality and the help lists its changes") {
  const auto json = nlohmann::json::parse(densify({"config", "--quality", "paper"}).out);
  CHECK(json["patchmatch"]["fine_patch"] == 1.0);
  CHECK(json["consistency"]["max_relative_depth"] == 0.08);
  const std::string help = densify({"run", "--help-all"}).out;
  CHECK_THAT(help, Contains("or paper") && Contains("paper 0.08"));
}

TEST_CASE("the last of several flags wins") {
  const auto median = [](const std::vector<std::string>& flags) {
    return nlohmann::json::parse(densify(flags).out)["median"]["enabled"].get<bool>();
  };
  CHECK(median({"config", "--no-median-enabled", "--median-enabled"}));
  CHECK_FALSE(median({"config", "--median-enabled", "--no-median-enabled"}));
  CHECK(nlohmann::json::parse(densify({"config", "--seed", "4", "--seed", "5"}).out)["seed"] == 5);
}

TEST_CASE("errors in a configuration file are named with the nearest key") {
  const TempDir dir;
  const std::string file = (dir / "c.json").string();
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases{
      {R"({"patchmatch": {"iteration": 3}})", {"\"patchmatch.iteration\"", "did you mean patchmatch.iterations?"}},
      {R"({"patchmtch": {"iterations": 3}})", {"patchmtch"}},
      {R"({"sed": 3})", {"\"sed\"", "did you mean seed?"}},
      {R"({"patchmatch": 3})", {"patchmatch", "object"}},
      {R"({"patchmatch": {"iterations": "3"}})", {"patchmatch.iterations", "whole number"}},
      {R"({"patchmatch": {"iterations": 2.5}})", {"patchmatch.iterations", "2.5"}},
      {R"({"patchmatch": {"iterations": 101}})", {"patchmatch.iterations", "101", "1 to 100"}},
      {R"({"median": {"enabled": 1}})", {"median.enabled", "true or false"}},
      {R"({"simd": "mmx"})", {"simd", "avx2"}},
      {R"({"quality": "best"})", {"quality", "best", "normal"}},
      {R"({"seed": -1})", {"seed", "-1"}},
      {R"([1, 2])", {"object"}},
      {R"({"seed": )", {"no JSON", "byte"}},
  };
  for (const auto& [text, expected] : cases) {
    write_text(file, text);
    const Result result = densify({"config", "--config", file});
    INFO(text << " -> " << result.err);
    CHECK(result.code == 2);
    CHECK_THAT(result.err, Contains(file));
    for (const std::string& word : expected) CHECK_THAT(result.err, Contains(word));
  }
}

TEST_CASE("a word within two letters is suggested") {
  CHECK(tool::suggestion("iteratons", {"seed", "iterations", "window"}) == "; did you mean iterations?");
  CHECK(tool::suggestion("iterate", {"seed", "iterations", "window"}).empty());
  CHECK(tool::suggestion("x", {}).empty());
}
