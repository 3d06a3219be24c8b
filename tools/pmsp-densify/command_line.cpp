// SPDX-License-Identifier: BSD-2-Clause
#include "command_line.h"

#include <unistd.h>
#include <algorithm>
#include <iostream>
#include <memory>
#include <utility>

#include <CLI/CLI.hpp>

#include "exit_code.h"
#include "options.h"
#include "progress.h"

namespace pmsp::tool {

void set_up_verb(CLI::App& app, const char* more) {
  wrap_help(app, 30);
  app.set_help_flag("-h,--help,--help-all", "All options");
  app.option_defaults()->take_last();
  app.allow_extras();
  app.footer(more);
}

bool parse_words(CLI::App& app, std::vector<std::string> words) {
  std::reverse(words.begin(), words.end());  // order of CLI11
  try {
    app.parse(std::move(words));
  } catch (const CLI::CallForHelp&) {
    std::cout << app.help() << "\n";
    return false;
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
  return true;
}

void refuse_extra_words(const CLI::App& app, const std::vector<std::string>& more) {
  const std::vector<std::string> extras = app.remaining();
  if (extras.empty()) return;
  std::string word = extras.front();
  if (word.rfind('-', 0) != 0) throw UsageError("unexpected argument \"" + word + "\"; see --help");
  word = word.substr(0, word.find('='));
  std::vector<std::string> names = more;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  throw UsageError("there is no option " + word + suggestion(word, names) + "; see --help-all");
}

namespace {

constexpr std::size_t kDefaultColumns = 100;
constexpr std::size_t kLeastColumns = 40;
constexpr std::size_t kNameColumns = 22;  ///< of short_help

struct HelpLine {
  const char* name;
  const char* value;
  const char* what;
};

constexpr HelpLine kVerbs[] = {
    {"run", "", "map and images to a cloud (the default)"},
    {"info", "", "checks and forecast of a run, before its arguments"},
    {"fuse", "", "existing depth maps to a cloud"},
    {"convert", "", "cloud to another format, frame, unit or amount"},
    {"report", "", "page for a browser, of a cloud or a workspace"},
    {"serve", "", "report and its directory over HTTP"},
    {"batch", "", "list of missions, each in a separate directory"},
    {"merge", "", "shards (run --shard) to a cloud"},
    {"config", "", "options in force as JSON, for --config"},
};

/// Common options of `run`, `fuse` and `info`.
constexpr HelpLine kCommon[] = {
    {"images", "DIR", "images of the keyframes, by name in MAP, keyframe id, timestamp or frame index"},
    {"video", "FILE", "the video that the SLAM processed, instead of --images"},
    {"fps", "F", "frame rate that turns timestamps into frame indices [default: that of the map]"},
    {"mask", "FILE|DIR", "image or directory: black is ignored, instead of automatic masks and rig"},
    {"mask-nadir", "DEG", "radius of an ignored cap below the camera"},
    {"no-verify", "", "no check that images, poses and map belong together"},
    {"quality", "NAME", "online (fast, coarse), normal (default), high (size of the images) or paper"},
    {"config", "FILE", "options as `config` prints them; flags override them"},
    {"backend", "NAME", "auto (default), cpu or cuda"},
    {"device", "N", "CUDA devices, such as 0 or 0,1 or all"},
    {"threads", "N", "threads of the CPU [default: all]"},
    {"min-confidence", "C", "least confidence of a point, 0 to 1 [default 0.1; paper 0]"},
    {"output", "FILE", "cloud; several allowed: .ply, .las, .potree and others [default cloud.ply]"},
    {"force", "", "overwrite existing outputs"},
    {"report", "FILE", "page for viewing and measuring (HTML)"},
    {"preview", "DIR", "pictures of the result (PNG)"},
    {"depth-maps", "DIR", "depth, normal and confidence of each keyframe"},
    {"stats", "FILE", "options, counts, warnings and times (JSON)"},
    {"scale", "S", "metres per map unit: makes a cloud in metres"},
    {"up", "", "z axis of the cloud points upwards"},
    {"align", "FILE", "control points, positions or trajectory that the cloud is aligned to, or exif"},
    {"max-points", "N", "maximum number of points"},
    {"workspace", "DIR", "cache: a later run computes only keyframes that are new or changed"},
    {"live-view", "PORT", "page that shows the points during the run"},
    {"depth-scale", "S", "fuse: map units per value of the depth images, or auto"},
    {"quiet", "", "warnings and errors only"},
    {"json", "", "info: output as JSON"},
    {"plan", "FILE", "info: file for the plan (JSON)"},
};

bool is_of_info_or_fuse(const HelpLine& line) { return std::string(line.what).find(": ") < 5; }

std::size_t columns() { return std::max(terminal_columns(STDOUT_FILENO, kDefaultColumns), kLeastColumns); }

/// Wraps text at `width`; lines after the first are indented by `indent`.
std::string wrapped(const std::string& text, std::size_t width, std::size_t indent) {
  std::string result;
  std::size_t used = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    at = end + 1;
    if (word.empty()) continue;
    if (used > 0 && used + 1 + word.size() > width) {
      result += "\n" + std::string(indent, ' ');
      used = 0;
    }
    if (used > 0) result += " ";
    result += word;
    used += (used > 0 ? 1 : 0) + word.size();
  }
  return result;
}

std::string line_of(const std::string& name, const std::string& what, std::size_t width) {
  std::string text = "  " + name;
  text.resize(std::max(text.size() + 1, kNameColumns), ' ');
  const std::size_t indent = kNameColumns;
  return text + wrapped(what, width > indent + 20 ? width - indent : 20, indent) + "\n";
}

class WrappedHelp : public CLI::Formatter {
 public:
  std::string make_option_desc(const CLI::Option* option) const override {
    return wrap(CLI::Formatter::make_option_desc(option));
  }

 private:
  std::string wrap(const std::string& text) const {
    const std::size_t width = columns();
    const std::size_t indent = get_column_width();
    return wrapped(text, width > indent + 20 ? width - indent : 20, 0);  // CLI11 indents by itself
  }
};

}  // namespace

bool is_common(const CLI::Option& option) {
  const std::vector<std::string>& names = option.get_lnames();
  return names.empty() || std::any_of(std::begin(kCommon), std::end(kCommon), [&](const HelpLine& line) {
           return std::find(names.begin(), names.end(), line.name) != names.end();
         });
}

std::string short_help() {
  const std::size_t width = columns();
  std::string text =
      wrapped("Dense, coloured point clouds from 360-degree images and the map of a SLAM or a reconstruction.", width,
              0) +
      "\n\nUsage: pmsp-densify [VERB] MAP --images DIR -o cloud.ply\n";
  for (const HelpLine& verb : kVerbs) text += line_of(verb.name, verb.what, width);
  text += "Options of run (--help-all: every option; VERB --help: those of another verb; --version: backends)\n";
  for (const HelpLine& line : kCommon) {
    if (is_of_info_or_fuse(line)) continue;
    const std::string name = line.name == std::string("output") ? "-o, --output" : std::string("--") + line.name;
    text += line_of(name + (*line.value != '\0' ? " " : "") + line.value, line.what, width);
  }
  return text +
         wrapped(
             "Exit codes: 0 done, 1 unexpected error, 2 usage, 3 input, 4 backend, 5 no points, 6 output, "
             "7 some, 8 all missions of a batch failed, 128 + n signal n",
             width, 0) +
         "\n";
}

void wrap_help(CLI::App& app, std::size_t column_width) {
  const auto formatter = std::make_shared<WrappedHelp>();
  formatter->column_width(column_width);
  app.formatter(formatter);
}

const std::vector<std::string>& verbs() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const HelpLine& verb : kVerbs) all.emplace_back(verb.name);
    return all;
  }();
  return names;
}

}  // namespace pmsp::tool
