// SPDX-License-Identifier: BSD-2-Clause
#include "command_line.h"

#include <algorithm>
#include <iostream>
#include <utility>

#include <CLI/CLI.hpp>

#include "exit_code.h"
#include "help.h"
#include "option_flags.h"

namespace pmsp::tool {

void set_up_verb(CLI::App& app, const char* more) {
  wrap_help(app, 30);
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

}  // namespace pmsp::tool
