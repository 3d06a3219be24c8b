// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <csignal>
#include <exception>
#include <iostream>
#include <numeric>
#include <system_error>

#include "batch_arguments.h"
#include "batch_jobs.h"
#include "batch_manifest.h"
#include "batch_mission.h"
#include "devices.h"
#include "exit_code.h"
#include "export/files.h"
#include "export/folder_lock.h"
#include "pmsp/stages.h"
#include "process.h"
#include "progress.h"
#include "tool_files.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

/// `now`: list and options of this call, recorded ones where omitted.
struct Lists {
  std::optional<Manifest> before;
  Manifest now;
};

/// Throws UsageError if an option differs from the recorded one, InvalidInput without a list.
Lists lists_of(const BatchArguments& arguments) {
  Lists lists{read_record(arguments.output), {}};
  const std::string folder = arguments.output.string();
  if (arguments.manifest.empty() && !lists.before) {
    throw InvalidInput(
        folder + ": is no directory of a batch, batch.json is missing; give the list of missions: batch MANIFEST -o " +
        folder);
  }
  lists.now = arguments.manifest.empty() ? *lists.before : read_manifest(arguments.manifest);
  lists.now.options = arguments.options;
  if (!lists.before) return lists;
  const std::string change = difference(lists.before->options, arguments.options);
  if (!change.empty() && !arguments.force) {
    throw UsageError(folder + ": contains results with other options: " + change +
                     "; omit the option to resume as recorded, give another -o, or --force to repeat the missions");
  }
  lists.now.options = merged(lists.before->options, arguments.options);
  return lists;
}

class Batch {
 public:
  explicit Batch(const BatchArguments& arguments)
      : arguments_(arguments),
        progress_(arguments.progress, arguments.quiet, false),
        lists_(lists_of(arguments)),
        output_(fs::absolute(arguments.output).lexically_normal()),
        slots_(static_cast<std::size_t>(arguments.jobs)),
        shares_(arguments.memory ? *arguments.memory * kGiB : free_host_memory()) {
    if (!arguments.manifest.empty()) {
      for (Mission& mission : lists_.now.missions) check_options(mission);
    }
    const workspace::Shard share = arguments.only.value_or(workspace::Shard{});
    for (const Mission& mission : lists_.now.missions) {
      all_.push_back(mission_of(mission));
      if (static_cast<int>((all_.size() - 1) % static_cast<std::size_t>(share.count)) == share.index) {
        missions_.push_back(all_.back());
      }
    }
    if (arguments.jobs > 1) cpus_ = Executor().threads();
    devices_ = devices();
  }

  /// Reports the missions' recorded states. Read-only.
  int summarise() {
    missions_ = recorded();
    report();
    return exit_code();
  }

  /// Runs `info` for each mission. Read-only.
  int check() {
    std::vector<BatchMission*> to_check;
    for (BatchMission& mission : missions_) {
      if (mission.mission.error.empty()) {
        to_check.push_back(&mission);
      } else {
        refuse(mission, mission.mission.error);
        print_end(mission);
      }
    }
    to_do_ = to_check.size();
    const int stopped = work_through(to_check);
    report();
    return exit_code(stopped);
  }

  int run() {
    std::vector<BatchMission*> waiting;
    for (BatchMission& mission : missions_) {
      if (is_to_do(mission)) waiting.push_back(&mission);
    }
    int stopped = 0;
    if (!waiting.empty() || lists_.before) {
      make_folder(output_);
      const FolderLock lock(output_, "directory of a batch", {},
                            arguments_.only ? FolderLock::For::kMany : FolderLock::For::kOne);
      write_record(output_, lists_.now);
      for (const BatchMission& mission : missions_) {
        if (has_state(mission.status, kDone)) drop_workspace(mission);
      }
      announce(waiting.size());
      stopped = work_through(waiting);
      write_tables();
    } else {
      announce(0);
    }
    report();
    return exit_code(stopped);
  }

 private:
  struct Slot {
    enum class Step {
      kQuery,  ///< child process that reports the memory need, or with --dry-run whether the mission is valid
      kWaits,  ///< for memory
      kRuns
    };

    BatchMission* mission = nullptr;  ///< nullptr = idle
    Step step = Step::kRuns;
    pid_t process = -1;
    Clock::time_point start;
    std::size_t log_begin = 0;  ///< offset of this run in the mission's log
    MemoryNeed need;
    std::optional<MemoryShares::Share> share;
    std::optional<FolderLock> lock;       ///< on the mission's folder, required for writing there
    std::optional<TemporaryFile> answer;  ///< of kQuery

    bool waits() const { return mission != nullptr && step == Step::kWaits; }
    void free() {
      mission = nullptr;
      need = {};
      share.reset();
      lock.reset();
      answer.reset();
    }
  };

  BatchMission mission_of(const Mission& mission) const {
    BatchMission result{mission, output_ / mission.name, lists_.now.options, {}, false};
    result.options.insert(result.options.end(), mission.options.begin(), mission.options.end());
    return result;
  }
  /// All missions of the list with their recorded states.
  BatchMissions recorded() const {
    BatchMissions missions = all_;
    for (BatchMission& mission : missions) look_at(mission);
    return missions;
  }

  std::vector<std::string> words_of(const BatchMission& mission) const {
    return run_words(mission, arguments_.program, lists_.now.folder);
  }

  void check_options(Mission& mission) const {
    if (!mission.error.empty()) return;
    try {
      check_run_words(words_of(mission_of(mission)));
    } catch (const std::exception& error) {
      mission.error = lists_.now.path + ": line " + std::to_string(mission.line) + ": " + error.what();
    }
  }

  /// Devices shared among the jobs; empty = each run uses its own option.
  std::vector<int> devices() const {
    if (arguments_.devices && !arguments_.devices->empty()) return *arguments_.devices;
    const bool is_for_gpus = arguments_.jobs > 1 && value_in(lists_.now.options, "--backend") != "cpu";
    std::vector<int> all(arguments_.devices || is_for_gpus ? static_cast<std::size_t>(device_count()) : 0);
    std::iota(all.begin(), all.end(), 0);
    return all;
  }

  bool is_settled(const BatchMission& mission, const MissionStatus& status, const std::string& fingerprint) const {
    const bool is_same = text_in(status, kFingerprint) == fingerprint;
    if (has_state(status, kFailed)) return is_same && !arguments_.retry;
    return has_state(status, kDone) && has_results(mission) &&
           (is_same || !has_inputs(mission.mission, lists_.now.folder));
  }

  /// True for pending missions, whose state becomes waiting. Throws UsageError if a changed line would replace results.
  bool is_to_do(BatchMission& mission) const {
    look_at(mission);
    const MissionStatus status = mission.status;
    const std::string before = text_in(status, kFingerprint);
    if (has_state(status, kFailed) && before.empty()) return false;  // rejected
    const std::string fingerprint = fingerprint_of(mission.mission, mission.options, lists_.now.folder);
    if (is_settled(mission, status, fingerprint)) return false;
    const bool is_begun = has_state(status, kDone) || has_state(status, kInterrupted);
    if (is_begun && before != fingerprint && !arguments_.force) check_line(mission.mission);
    mission.status = {{"state", kWaiting}, {kFingerprint, fingerprint}};
    return true;
  }

  void check_line(const Mission& mission) const {
    if (!lists_.before) return;
    for (const Mission& before : lists_.before->missions) {
      const std::string change = before.name == mission.name ? line_difference(before, mission) : "";
      if (change.empty()) continue;
      throw UsageError(lists_.now.path + ": line " + std::to_string(mission.line) + ": mission " + mission.name +
                       " has results of another line: " + change + "; give another \"name\", or --force to repeat it");
    }
  }

  void announce(std::size_t waiting) {
    to_do_ = waiting;
    const std::size_t size = missions_.size();
    std::string text = std::to_string(size) + (size == 1 ? " mission: " : " missions: ") +
                       std::to_string(count(missions_, kDone)) + " done before, ";
    const std::size_t failed = count(missions_, kFailed);
    if (failed > 0) text += std::to_string(failed) + " failed" + (arguments_.retry ? "" : " (see --retry)") + ", ";
    text += std::to_string(waiting) + " to do";
    if (arguments_.jobs > 1) text += ", " + std::to_string(arguments_.jobs) + " at once";
    if (!lists_.now.options.empty()) text += "; options: " + command_text(lists_.now.options);
    progress_.message(text);
    for (const BatchMission& mission : missions_) {
      if (has_state(mission.status, kFailed)) print_end(mission);
    }
  }

  /// Returns the signal that interrupted it, or 0.
  int work_through(const std::vector<BatchMission*>& waiting) {
    SignalQueue signals;
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
          if (slot.mission != nullptr && !slot.waits()) kill(slot.process, signal);
        }
      }
      for (Slot& slot : slots_) {
        if (stopped != 0 && slot.waits()) end(slot, kInterrupted, "");
      }
      share_out_memory();
    }
    return stopped;
  }

  /// In the order of the list, so that large missions are not starved by small ones.
  void share_out_memory() {
    std::vector<Slot*> waiting;
    for (Slot& slot : slots_) {
      if (slot.waits()) waiting.push_back(&slot);
    }
    std::sort(waiting.begin(), waiting.end(), [](const Slot* a, const Slot* b) { return a->mission < b->mission; });
    for (Slot* slot : waiting) {
      slot->share = shares_.take(slot->need);
      if (!slot->share) return print_waiting(*slot);
      run(*slot);
    }
  }

  void start(std::size_t index, BatchMission& mission) {
    Slot& slot = slots_[index];
    slot.mission = &mission;
    try {
      if (!arguments_.dry_run && !take_folder(slot, mission)) return slot.free();
      mission.has_run = true;
      std::vector<std::string> words = words_of(mission);
      share_out(index, words);
      mission.status = {{"state", kRunning},
                        {"host", host_},
                        {"version", version_text()},
                        {"started", time_text()},
                        {kFingerprint, text_in(mission.status, kFingerprint)},
                        {"command", words}};
      if (slot.lock) write_status(mission.folder, mission.status);  // first: marks the folder as a mission's
      if (arguments_.dry_run) {
        words[1] = "info";
        query(slot, words);
      } else if (arguments_.jobs > 1) {
        words.emplace_back("--print-memory");
        query(slot, words);
      } else {
        run(slot);
      }
    } catch (const std::exception& error) {
      end(slot, kFailed, error.what());
    }
  }

  /// In a child process, so that a broken map fails its mission only.
  static void query(Slot& slot, const std::vector<std::string>& words) {
    slot.step = Slot::Step::kQuery;
    slot.answer.emplace();
    slot.start = Clock::now();
    slot.process = start_child(words, slot.answer->path());
  }

  /// An unknown need counts as 0: the run reports the error.
  static void take_need(Slot& slot) {
    slot.step = Slot::Step::kWaits;
    slot.need = memory_need_from(read_whole_file(slot.answer->path()));
  }

  void run(Slot& slot) {
    BatchMission& mission = *slot.mission;
    const fs::path log = log_of(mission.folder);
    try {
      slot.step = Slot::Step::kRuns;
      slot.start = Clock::now();
      slot.log_begin = begin_log(log, mission.status);
      slot.process = start_child(mission.status["command"], log);
    } catch (const std::exception& error) {
      return end(slot, kFailed, error.what());
    }
    try {
      mission.status["process"] = slot.process;
      write_status(mission.folder, mission.status);
    } catch (const std::exception&) {  // the run has started; its end will be recorded
    }
  }

  /// Records the end of a mission and frees its slot.
  void end(Slot& slot, const char* state, const std::string& reason) {
    BatchMission& mission = *slot.mission;
    mission.status["state"] = state;
    if (!reason.empty()) mission.status["reason"] = reason;
    mission.status["finished"] = time_text();
    try {
      if (slot.lock) write_status(mission.folder, mission.status);
      if (slot.lock && has_state(mission.status, kDone)) drop_workspace(mission);
    } catch (const std::exception& error) {
      refuse(mission, error.what());
    }
    if (slot.share) shares_.give_back(*slot.share);
    slot.free();
    print_end(mission);
  }

  void print_waiting(const Slot& slot) {
    if (slot.mission == printed_waiting_) return;
    printed_waiting_ = slot.mission;
    progress_.message(slot.mission->mission.name + ": waits for memory of others");
  }

  /// False if another process has completed the mission in the meantime. Throws OutputError if one is running it.
  bool take_folder(Slot& slot, BatchMission& mission) const {
    make_folder(mission.folder);
    slot.lock.emplace(mission.folder, kLockedFolder, kPatience);
    const std::optional<MissionStatus> status = read_status(mission.folder);
    if (!status) return true;
    if (has_state(*status, kRunning)) wait_for_killed(workspace_of(mission.folder));
    if (!is_settled(mission, *status, text_in(mission.status, kFingerprint))) return true;
    mission.status = *status;
    return false;
  }

  /// Runs of a killed batch are killed as well, possibly with some delay.
  static void wait_for_killed(const fs::path& workspace) {
    std::error_code error;
    if (!fs::is_directory(workspace, error)) return;
    try {
      const FolderLock lock(workspace, "workspace", kPatience);
    } catch (const OutputError&) {
      return;  // reported by the run
    }
  }

  /// Adds the job's share of CPUs and GPUs, unless set by its options.
  void share_out(std::size_t slot, std::vector<std::string>& words) const {
    if (cpus_ > 0 && value_in(words, "--threads").empty()) {
      const int jobs = arguments_.jobs;
      const int share = cpus_ / jobs + (static_cast<int>(slot) < cpus_ % jobs ? 1 : 0);
      words.push_back("--threads=" + std::to_string(std::max(share, 1)));
    }
    if (!devices_.empty() && value_in(words, "--device").empty()) {
      std::string list;
      for (const int device : devices_of_job(slot, slots_.size(), devices_)) {
        list += (list.empty() ? "" : ",") + std::to_string(device);
      }
      words.push_back("--device=" + list);
    }
  }

  void look_for_end(Slot& slot, bool is_stopped) {
    if (slot.mission == nullptr || slot.waits()) return;
    const std::optional<ChildEnd> child = end_of_child(slot.process);
    if (!child) return;
    if (slot.step == Slot::Step::kQuery && !arguments_.dry_run) return take_need(slot);
    const fs::path log = arguments_.dry_run ? slot.answer->path() : log_of(slot.mission->folder);
    MissionStatus& status = slot.mission->status;
    status.erase("process");
    status["exit_code"] = child->signal ? kExitSignal + *child->signal : *child->exit_code;
    status["seconds"] = seconds_since(slot.start);
    status["peak_memory_mib"] = child->peak_memory_mib;
    if (child->exit_code == kExitOk) {
      if (slot.lock) read_stats(stats_of(slot.mission->folder), status);
      end(slot, kDone, arguments_.dry_run ? warning_in(log) : "");
    } else if (is_stopped && status["exit_code"] > static_cast<int>(kExitSignal)) {
      end(slot, kInterrupted, "");
    } else {
      end(slot, kFailed, reason_of(*child, log, slot.log_begin));
    }
  }

  /// Only after the status is done: a partially deleted workspace is useless.
  static void drop_workspace(const BatchMission& mission) {
    std::error_code ignored;
    if (value_in(mission.options, kKeepWorkspaces) != "true") fs::remove_all(workspace_of(mission.folder), ignored);
  }

  void print_end(const BatchMission& mission) {
    const MissionStatus& status = mission.status;
    if (mission.has_run) ++ended_;
    nlohmann::ordered_json event{{"event", "mission"}, {"name", mission.mission.name}, {"line", mission.mission.line}};
    event.update(status);
    progress_.event(event);
    if (arguments_.progress == ProgressMode::kJson || (arguments_.dry_run && !arguments_.quiet)) return;
    std::string text = mission.mission.name + ": " + text_in(status, "state");
    if (mission.has_run) text = std::to_string(ended_) + "/" + std::to_string(to_do_) + " " + text;
    const std::string reason = text_in(status, "reason");
    if (has_state(status, kFailed)) return progress_.warning(text + ": " + reason);
    if (status.contains("points")) text += ", " + count_text(status["points"].get<std::int64_t>()) + " points";
    progress_.message(text + ", " + duration_text(status.value("seconds", 0.0)));
    if (!reason.empty()) progress_.message(mission.mission.name + ": " + reason);
  }

  /// Covers all missions, also if this call processes a share of them. Repeated until stable, since the last of several
  /// processes must write the states of all.
  void write_tables() const {
    for (std::string written;;) {
      const BatchMissions missions = recorded();
      const std::string csv = csv_text(missions);
      if (csv == written) return;
      write_if_changed(output_ / "missions.csv", csv);
      write_if_changed(output_ / "index.html", page_text(missions, lists_.now.path, output_));
      written = csv;
    }
  }

  void report() {
    if (arguments_.progress != ProgressMode::kJson && !arguments_.quiet) {
      std::cout << (arguments_.dry_run ? checks_text(missions_) : table_text(missions_) + summary(missions_))
                << (arguments_.summary ? "" : "; " + duration_text(seconds_since(start_))) << "\n";
    }
    nlohmann::ordered_json result;
    for (const char* state : {kDone, kFailed, kRunning, kInterrupted, kWaiting})
      result[state] = count(missions_, state);
    result["seconds"] = seconds_since(start_);
    progress_.done(result);
  }

  /// `stopped`: signal that ended the batch; 0 = none.
  int exit_code(int stopped = 0) const {
    if (stopped != 0) return kExitSignal + stopped;
    if (count(missions_, kDone) == missions_.size()) return kExitOk;
    return count(missions_, kFailed) == missions_.size() ? kExitAllFailed : kExitSomeFailed;
  }

  static constexpr const char* kFingerprint = "fingerprint";
  static constexpr double kGiB = 1024.0 * 1024.0 * 1024.0;
  static constexpr std::chrono::seconds kPatience{20};  ///< for locks of a killed process

  const BatchArguments& arguments_;
  Clock::time_point start_ = Clock::now();
  Progress progress_;
  Lists lists_;
  fs::path output_;
  BatchMissions all_;
  BatchMissions missions_;  ///< of this call
  std::vector<Slot> slots_;
  MemoryShares shares_;
  const std::string host_ = host_name();
  const BatchMission* printed_waiting_ = nullptr;
  int cpus_ = 0;              ///< to be shared; 0 = each run uses all
  std::vector<int> devices_;  ///< to be shared
  std::size_t to_do_ = 0;
  std::size_t ended_ = 0;  ///< out of to_do_
};

void scan(const fs::path& folder) {
  const Scan found = scan_for_missions(folder);
  for (const nlohmann::ordered_json& mission : found.missions) {
    std::cout << mission.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n";
  }
  for (const fs::path& map : found.without_images) {
    std::cerr << "warning: " << map.string() << ": no images or video beside it, ignored; see batch --help\n";
  }
  if (found.missions.empty()) {
    throw InvalidInput(folder.string() +
                       ": no mission in it; expected maps (*.msg, *.db, reconstruction.json, sparse/0) with images "
                       "beside them");
  }
}

int run_batch(const BatchArguments& arguments) {
  if (!arguments.scan.empty()) {
    scan(arguments.scan);
    return kExitOk;
  }
  if (!arguments.slurm.empty()) {
    const std::string script = slurm_script(arguments, lists_of(arguments).now.missions.size());
    if (arguments.slurm == "submit") {
      submit(script);
    } else {
      std::cout << script;
    }
    return kExitOk;
  }
  Batch batch(arguments);
  return arguments.summary ? batch.summarise() : arguments.dry_run ? batch.check() : batch.run();
}

}  // namespace

int batch(int argc, const char* const* argv) {
  const std::optional<BatchArguments> arguments = parse_batch_arguments(argc, argv);
  if (!arguments) return kExitOk;
  const int code = run_batch(*arguments);
  std::cout.flush();
  if (!std::cout) throw OutputError("standard output cannot be written");
  return code;
}

}  // namespace pmsp::tool
