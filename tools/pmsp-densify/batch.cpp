// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <exception>
#include <fstream>
#include <iostream>
#include <system_error>

#include "batch_arguments.h"
#include "batch_manifest.h"
#include "batch_options.h"
#include "batch_report.h"
#include "batch_scan.h"
#include "batch_status.h"
#include "child_process.h"
#include "depth_output.h"
#include "exit_code.h"
#include "export/atomic_file.h"
#include "export/regular_file.h"
#include "file_state.h"
#include "pmsp/executor.h"
#include "progress.h"
#include "util/folder_lock.h"
#include "verbs.h"
#include "workspace/fingerprint.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// A file's name as a word of a command line, where a leading "-" would make it an option.
std::string as_word(const fs::path& path) {
  const std::string text = path.string();
  return !text.empty() && text[0] == '-' ? "./" + text : text;
}

/// The last thing that a run said in its log, which is why it failed.
std::string last_words(const fs::path& log) {
  constexpr std::streamoff kTail = 1 << 16;
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : 0;
  file.seekg(std::max<std::streamoff>(size - kTail, 0));
  const std::string prefix = "pmsp-densify: ";
  std::string last, error;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(prefix, 0) == 0) error = line.substr(prefix.size());
    if (!line.empty()) last = line;
  }
  return error.empty() ? last : error;
}

std::string reason_of(const ChildEnd& end, const fs::path& log) {
  if (end.signal) {
    const std::string text = "killed by signal " + std::to_string(*end.signal) + " (" + strsignal(*end.signal) + ")";
    return *end.signal == SIGKILL ? text + "; memory may have run out" : text;
  }
  const std::string words = last_words(log);
  return words.empty() ? "ended with exit code " + std::to_string(*end.exit_code) : words;
}

std::optional<std::int64_t> points_in(const fs::path& stats) {
  try {
    return nlohmann::json::parse(read_whole_file(stats)).at("points").get<std::int64_t>();
  } catch (const std::exception&) {
    return std::nullopt;  // the cloud is there all the same
  }
}

class Batch {
 public:
  explicit Batch(const BatchArguments& arguments)
      : arguments_(arguments), progress_(arguments.progress, arguments.quiet, false) {
    const Manifest manifest = read_manifest(arguments.manifest);
    inputs_ = manifest.folder;
    report_.manifest = arguments.manifest;
    for (const Mission& mission : manifest.missions) {
      report_.missions.push_back({mission, arguments.output / mission.name, {}, false, false});
    }
    slots_.resize(static_cast<std::size_t>(arguments.jobs));
    if (arguments.jobs > 1) cpus_ = Executor().threads();
  }

  int operator()() {
    make_folder(arguments_.output);
    const FolderLock lock(arguments_.output, "folder of a batch");
    std::vector<BatchMission*> waiting;
    for (BatchMission& mission : report_.missions) {
      look_at(mission);
      if (mission.status.state == MissionState::kWaiting) waiting.push_back(&mission);
    }
    announce(waiting.size());
    SignalQueue signals;
    const int stopped = work_through(waiting, signals);
    report_.seconds = seconds_since(start_);
    tell();
    if (stopped != 0) return kExitSignal + stopped;
    const std::size_t done = report_.count(MissionState::kDone);
    if (done == report_.missions.size()) return kExitOk;
    return done > 0 ? kExitSomeFailed : kExitAllFailed;
  }

 private:
  struct Slot {
    BatchMission* mission = nullptr;  ///< nullptr: free
    pid_t process = -1;
    Clock::time_point start;
  };

  std::string input(const std::string& name) const { return as_word(inputs_ / name); }

  /// The command line of its run, but for what the slot gives it.
  std::vector<std::string> words_of(const BatchMission& mission) const {
    const Mission& m = mission.mission;
    std::vector<std::string> words{arguments_.program, "run", input(m.map)};
    words.push_back(m.video.empty() ? "--images=" + input(m.images) : "--video=" + input(m.video));
    for (const auto* options : {&arguments_.options, &m.options}) {
      const std::vector<std::string> here = options_in(mission.folder, *options);
      words.insert(words.end(), here.begin(), here.end());
    }
    if (!m.mask.empty()) words.push_back("--mask=" + input(m.mask));
    words.push_back("--workspace=" + workspace_of(mission).string());
    words.push_back("--output=" + cloud_of(mission).string());
    words.push_back("--stats=" + stats_of(mission).string());
    words.insert(words.end(), {"--force", "--progress=plain"});
    return words;
  }

  static fs::path workspace_of(const BatchMission& mission) { return mission.folder / "work"; }
  static fs::path cloud_of(const BatchMission& mission) { return mission.folder / "cloud.ply"; }
  static fs::path stats_of(const BatchMission& mission) { return mission.folder / "stats.json"; }
  static fs::path log_of(const BatchMission& mission) { return mission.folder / "log.txt"; }

  /// Throws what is wrong with the options.
  void check_words(const BatchMission& mission) const {
    try {
      understand(words_of(mission));
    } catch (const std::exception& error) {
      throw UsageError(report_.manifest + ": line " + std::to_string(mission.mission.line) + ": " + error.what());
    }
  }

  static void understand(const std::vector<std::string>& words) {
    std::vector<const char*> argv;
    argv.reserve(words.size());
    for (const std::string& word : words) argv.push_back(word.c_str());
    const auto arguments = parse_arguments(static_cast<int>(argv.size()), argv.data());
    if (arguments) effective_options(*arguments);
  }

  /// Of what decides the result: what the manifest and the command line say, wherever they lie, and the states of the
  /// files that they name.
  std::string fingerprint_of(const Mission& mission) const {
    workspace::Fingerprint fingerprint;
    for (const std::string* name : {&mission.map, &mission.images, &mission.video, &mission.mask}) {
      fingerprint.add(*name).add(name->empty() ? std::string() : state_of(inputs_ / *name));
    }
    if (!mission.images.empty()) fingerprint.add(state_of_files_in(inputs_ / mission.images));
    for (const auto* options : {&arguments_.options, &mission.options}) {
      for (const std::string& option : *options) add_option(fingerprint, option);
    }
    return fingerprint.text();
  }

  static void add_option(workspace::Fingerprint& fingerprint, const std::string& option) {
    if (is_of_machine(option)) return;
    for (const char* name : {"--config", "--mask"}) {
      const std::string file = value_of(option, name);
      if (file.empty()) continue;
      fingerprint.add(name).add(state_of(file));
      return;
    }
    fingerprint.add(option);
  }

  /// What is known of it from before: afterwards it is done, has failed, or waits.
  void look_at(BatchMission& mission) {
    MissionStatus fresh;
    try {
      if (!mission.mission.is_named) throw InvalidInput(mission.mission.error);
      fresh.fingerprint = fingerprint_of(mission.mission);
      fresh.keeps_workspace = arguments_.keep_workspaces;
      const std::optional<MissionStatus> earlier = status_before(mission);
      if (!mission.mission.error.empty()) throw InvalidInput(mission.mission.error);
      check_words(mission);
      if (earlier && is_settled(*earlier, fresh, mission)) {
        mission.status = *earlier;
        if (earlier->state == MissionState::kDone) drop_workspace(mission);
        return;
      }
      mission.status = fresh;
    } catch (const std::exception& error) {
      mission.status = fresh;
      finish(mission, MissionState::kFailed, error.what());
    }
  }

  std::optional<MissionStatus> status_before(BatchMission& mission) const {
    std::optional<MissionStatus> earlier = read_status(mission.folder);
    std::error_code error;
    if (!earlier && fs::exists(mission.folder, error) && !fs::is_empty(mission.folder, error)) {
      throw OutputError(mission.folder.string() +
                        ": is there already, and not of a batch; give the mission another \"name\", or another -o");
    }
    if (earlier && earlier->state == MissionState::kRunning && fs::is_directory(workspace_of(mission), error)) {
      wait_for_killed(workspace_of(mission));
    }
    mission.has_folder = true;
    return earlier;
  }

  /// What ran in a batch that was killed is killed as well, but may take a moment to end.
  static void wait_for_killed(const fs::path& workspace) {
    try {
      const FolderLock lock(workspace, "workspace", std::chrono::seconds(20));
    } catch (const OutputError&) {
      return;  // its run will say so
    }
  }

  bool is_settled(const MissionStatus& earlier, const MissionStatus& fresh, const BatchMission& mission) const {
    std::error_code ignored;
    if (earlier.fingerprint != fresh.fingerprint) return false;
    if (earlier.state == MissionState::kFailed) return !arguments_.retry;
    return earlier.state == MissionState::kDone && fs::exists(cloud_of(mission), ignored);
  }

  void announce(std::size_t waiting) {
    to_do_ = waiting;
    std::string text = std::to_string(report_.missions.size()) +
                       " missions: " + std::to_string(report_.count(MissionState::kDone)) + " done before, ";
    const std::size_t failed = report_.count(MissionState::kFailed);
    if (failed > 0) text += std::to_string(failed) + " failed" + (arguments_.retry ? "" : " (see --retry)") + ", ";
    text += std::to_string(waiting) + " to do";
    if (arguments_.jobs > 1) text += ", " + std::to_string(arguments_.jobs) + " at once";
    progress_.message(text);
    for (const BatchMission& mission : report_.missions) {
      if (mission.status.state == MissionState::kFailed) tell_end(mission);
    }
  }

  /// Returns the signal that ended it before its time, or 0.
  int work_through(const std::vector<BatchMission*>& waiting, SignalQueue& signals) {
    std::size_t next = 0;
    int stopped = 0;
    for (;;) {
      for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
        while (stopped == 0 && next < waiting.size() && slots_[slot].mission == nullptr) start(slot, *waiting[next++]);
      }
      if (std::all_of(slots_.begin(), slots_.end(), [](const Slot& slot) { return slot.mission == nullptr; })) break;
      const int signal = signals.wait();
      if (signal == SIGCHLD) {
        for (Slot& slot : slots_) look_for_end(slot, stopped != 0);
      } else {
        stopped = signal;
        for (const Slot& slot : slots_) {
          if (slot.mission != nullptr) kill(slot.process, signal);
        }
      }
    }
    return stopped;
  }

  void start(std::size_t index, BatchMission& mission) {
    Slot& slot = slots_[index];
    MissionStatus& status = mission.status;
    mission.has_run = true;
    try {
      make_folder(mission.folder);
      status.command = words_of(mission);
      share_out(index, status.command);
      status.started = time_text();
      status.state = MissionState::kRunning;
      write_status(mission.folder, status);  // first: it says whose folder it is
      slot.start = Clock::now();
      slot.process = start_child(status.command, log_of(mission));
      slot.mission = &mission;
      status.process = slot.process;
      write_status(mission.folder, status);
    } catch (const std::exception& error) {
      if (slot.mission != nullptr) return;  // it runs; its end will be written
      finish(mission, MissionState::kFailed, error.what());
      tell_end(mission);
    }
  }

  /// Its share of CPUs and GPUs, unless it is given them.
  void share_out(std::size_t slot, std::vector<std::string>& words) const {
    const auto is_given = [&words](const char* name) {
      return std::any_of(words.begin(), words.end(),
                         [&](const std::string& word) { return !value_of(word, name).empty(); });
    };
    if (cpus_ > 0 && !is_given("--threads")) {
      const int jobs = arguments_.jobs;
      const int share = cpus_ / jobs + (static_cast<int>(slot) < cpus_ % jobs ? 1 : 0);
      words.push_back("--threads=" + std::to_string(std::max(share, 1)));
    }
    if (!arguments_.devices.empty() && !is_given("--device")) {
      words.push_back("--device=" + std::to_string(arguments_.devices[slot % arguments_.devices.size()]));
    }
  }

  void look_for_end(Slot& slot, bool is_stopped) {
    if (slot.mission == nullptr) return;
    const std::optional<ChildEnd> end = end_of_child(slot.process);
    if (!end) return;
    BatchMission& mission = *slot.mission;
    MissionStatus& status = mission.status;
    slot.mission = nullptr;
    status.process.reset();
    status.exit_code = end->exit_code;
    status.signal = end->signal;
    status.seconds = seconds_since(slot.start);
    status.peak_memory_mib = end->peak_memory_mib;
    if (end->exit_code == kExitOk) {
      status.points = points_in(stats_of(mission));
      finish(mission, MissionState::kDone, "");
      if (status.state == MissionState::kDone) drop_workspace(mission);
    } else {
      const bool by_signal = end->signal || *end->exit_code > kExitSignal;
      finish(mission, is_stopped && by_signal ? MissionState::kInterrupted : MissionState::kFailed,
             reason_of(*end, log_of(mission)));
    }
    tell_end(mission);
  }

  void finish(BatchMission& mission, MissionState state, const std::string& reason) {
    mission.status.state = state;
    mission.status.reason = reason;
    mission.status.finished = time_text();
    if (!mission.has_folder) return;
    try {
      make_folder(mission.folder);
      write_status(mission.folder, mission.status);
    } catch (const std::exception& error) {
      mission.status.state = MissionState::kFailed;
      mission.status.reason = error.what();
    }
  }

  /// Only after its status says that it is done: half a workspace is none.
  static void drop_workspace(const BatchMission& mission) {
    std::error_code ignored;
    if (!mission.status.keeps_workspace) fs::remove_all(workspace_of(mission), ignored);
  }

  void tell_end(const BatchMission& mission) {
    const MissionStatus& status = mission.status;
    if (mission.has_run) ++ended_;
    nlohmann::ordered_json event{{"event", "mission"}};
    event.update(to_json(mission));
    progress_.event(event);
    if (arguments_.progress == ProgressMode::kJson) return;
    std::string text = mission.mission.name + ": " + name_of(status.state);
    if (mission.has_run) text = std::to_string(ended_) + "/" + std::to_string(to_do_) + " " + text;
    if (!status.reason.empty()) text += ": " + status.reason;
    if (status.state == MissionState::kFailed) return progress_.warning(text);
    if (status.points) text += ", " + count_text(*status.points) + " points";
    progress_.message(text + ", " + duration_text(status.seconds));
  }

  void tell() {
    nlohmann::ordered_json json = to_json(report_);
    const fs::path file = arguments_.output / "batch.json";
    write_file(file, json_text(json));
    if (arguments_.progress != ProgressMode::kJson && !arguments_.quiet) {
      std::cout << table_text(report_) << summary(report_) << "\n";
    }
    json.erase("missions");
    json["output"] = file.string();
    progress_.done(json);
  }

  const BatchArguments& arguments_;
  Clock::time_point start_ = Clock::now();
  Progress progress_;
  fs::path inputs_;
  BatchReport report_;
  std::vector<Slot> slots_;
  int cpus_ = 0;  ///< to share out; 0 = each run takes what there is
  std::size_t to_do_ = 0;
  std::size_t ended_ = 0;  ///< of these
};

void scan(const fs::path& folder) {
  const Scan found = scan_for_missions(folder);
  for (const nlohmann::ordered_json& mission : found.missions) {
    std::cout << mission.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n";
  }
  for (const fs::path& map : found.without_images) {
    std::cerr << "warning: " << map.string() << ": no images or video beside it, left out; see batch --help\n";
  }
  if (found.missions.empty()) {
    throw InvalidInput(folder.string() + ": no mission in it; expected maps (*.msg, *.db) with images beside them");
  }
}

}  // namespace

int batch(int argc, const char* const* argv) {
  const std::optional<BatchArguments> arguments = parse_batch_arguments(argc, argv);
  if (!arguments) return kExitOk;
  if (!arguments->scan.empty()) {
    scan(arguments->scan);
    return kExitOk;
  }
  const int code = Batch(*arguments)();
  std::cout.flush();
  if (!std::cout) throw OutputError("standard output cannot be written");
  return code;
}

}  // namespace pmsp::tool
