// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <chrono>
#include <csignal>
#include <exception>
#include <iostream>
#include <system_error>

#include "batch_arguments.h"
#include "batch_manifest.h"
#include "batch_options.h"
#include "batch_page.h"
#include "batch_report.h"
#include "batch_run.h"
#include "batch_scan.h"
#include "batch_slurm.h"
#include "batch_status.h"
#include "child_process.h"
#include "depth_output.h"
#include "exit_code.h"
#include "memory_shares.h"
#include "pmsp/executor.h"
#include "pmsp/io/files.h"
#include "pmsp/io/folder_lock.h"
#include "progress.h"
#include "verbs.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

class Batch {
 public:
  explicit Batch(const BatchArguments& arguments)
      : arguments_(arguments),
        progress_(arguments.progress, arguments.quiet, false),
        slots_(static_cast<std::size_t>(arguments.jobs)),
        shares_(arguments.memory ? *arguments.memory * kGiB : free_host_memory()) {
    const Manifest manifest = read_manifest(arguments.manifest);
    inputs_ = manifest.folder;
    report_.manifest = arguments.manifest;
    for (std::size_t i = 0; i < manifest.missions.size(); ++i) {
      if (!is_ours(i)) continue;
      const Mission& mission = manifest.missions[i];
      report_.missions.push_back({mission, arguments.output / mission.name, {}, false, false});
    }
    if (arguments.jobs > 1) cpus_ = Executor().threads();
  }

  int operator()() {
    make_folder(arguments_.output);
    const bool is_alone = !arguments_.only && !arguments_.summary;
    const FolderLock lock(arguments_.output, "folder of a batch", {},
                          is_alone ? FolderLock::For::kOne : FolderLock::For::kMany);
    std::vector<BatchMission*> waiting;
    for (BatchMission& mission : report_.missions) {
      look_at(mission);
      if (mission.status.state == MissionState::kWaiting) waiting.push_back(&mission);
    }
    int stopped = 0;
    if (!arguments_.summary) {
      announce(waiting.size());
      SignalQueue signals;
      stopped = work_through(waiting, signals);
    }
    report_.seconds = seconds_since(start_);
    tell();
    if (stopped != 0) return kExitSignal + stopped;
    const std::size_t done = report_.count(MissionState::kDone);
    if (done == report_.missions.size()) return kExitOk;
    return done > 0 ? kExitSomeFailed : kExitAllFailed;
  }

 private:
  struct Slot {
    enum class Step {
      kAsks,   ///< a process says how much memory the mission will take
      kWaits,  ///< until that much is there
      kRuns
    };

    BatchMission* mission = nullptr;  ///< nullptr: free
    Step step = Step::kRuns;
    pid_t process = -1;
    Clock::time_point start;
    MemoryNeed need;
    std::optional<MemoryShares::Share> share;
    std::optional<FolderLock> lock;  ///< of the mission's folder

    bool waits() const { return mission != nullptr && step == Step::kWaits; }
    void free() {
      mission = nullptr;
      need = {};
      share.reset();
      lock.reset();
    }
  };

  bool is_ours(std::size_t mission) const {
    if (!arguments_.only) return true;
    return mission % static_cast<std::size_t>(arguments_.only->count) ==
           static_cast<std::size_t>(arguments_.only->index);
  }

  void check_options(const BatchMission& mission) const {
    try {
      check_run_words(run_words(mission, arguments_, inputs_));
    } catch (const std::exception& error) {
      throw UsageError(report_.manifest + ": line " + std::to_string(mission.mission.line) + ": " + error.what());
    }
  }

  /// What is known of it from before: afterwards it is done, has failed, or waits.
  void look_at(BatchMission& mission) {
    MissionStatus fresh;
    try {
      if (!mission.mission.is_named) throw InvalidInput(mission.mission.error);
      fresh.fingerprint = fingerprint_of(mission.mission, arguments_, inputs_);
      fresh.keeps_workspace = arguments_.keep_workspaces;
      const std::optional<MissionStatus> earlier = status_before(mission);
      if (!mission.mission.error.empty()) throw InvalidInput(mission.mission.error);
      check_options(mission);
      if (earlier && is_settled(*earlier, fresh, mission)) {
        mission.status = *earlier;
        if (earlier->state == MissionState::kDone && !arguments_.summary) drop_workspace(mission);
        return;
      }
      mission.status = fresh;
      if (arguments_.summary && earlier) mission.status = unfinished(mission, *earlier, fresh);
    } catch (const std::exception& error) {
      mission.status = fresh;
      finish(mission, MissionState::kFailed, error.what());
    }
  }

  std::optional<MissionStatus> status_before(BatchMission& mission) const {
    std::optional<MissionStatus> earlier = read_status(mission.folder);
    if (!earlier && holds_anything(mission.folder)) {
      throw OutputError(mission.folder.string() +
                        ": is there already, and not of a batch; give the mission another \"name\", or another -o");
    }
    mission.has_folder = !arguments_.summary;
    return earlier;
  }

  /// Besides the lock and a first status, as far as a killed batch came with it.
  static bool holds_anything(const fs::path& folder) {
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      const std::string name = it->path().filename().string();
      if (name != FolderLock::kName && !is_unfinished_status(name)) return true;
    }
    return false;
  }

  /// For the table: a mission that is being made, or was when something killed its batch, or that waits.
  static MissionStatus unfinished(const BatchMission& mission, const MissionStatus& earlier,
                                  const MissionStatus& fresh) {
    if (earlier.state == MissionState::kInterrupted) return earlier;
    if (earlier.state != MissionState::kRunning) return fresh;
    MissionStatus status = earlier;
    try {
      const FolderLock lock(mission.folder, kLockedFolder);
      status.state = MissionState::kInterrupted;
    } catch (const OutputError&) {
      // it is being made
    }
    return status;
  }

  /// What ran in a batch that was killed is killed as well, but may take a moment to end.
  static void wait_for_killed(const fs::path& workspace) {
    std::error_code error;
    if (!fs::is_directory(workspace, error)) return;
    try {
      const FolderLock lock(workspace, "workspace", kPatience);
    } catch (const OutputError&) {
      return;  // its run will say so
    }
  }

  bool is_settled(const MissionStatus& earlier, const MissionStatus& fresh, const BatchMission& mission) const {
    std::error_code ignored;
    if (earlier.fingerprint != fresh.fingerprint) return false;
    if (earlier.state == MissionState::kFailed) return !arguments_.retry || arguments_.summary;
    std::vector<fs::path> results = clouds_of(mission, arguments_);
    if (const auto page = report_of(mission, arguments_)) results.push_back(*page);
    return earlier.state == MissionState::kDone &&
           std::all_of(results.begin(), results.end(), [&](const fs::path& it) { return fs::exists(it, ignored); });
  }

  void announce(std::size_t waiting) {
    to_do_ = waiting;
    const std::size_t count = report_.missions.size();
    std::string text = std::to_string(count) + (count == 1 ? " mission: " : " missions: ") +
                       std::to_string(report_.count(MissionState::kDone)) + " done before, ";
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
          if (slot.mission != nullptr && !slot.waits()) kill(slot.process, signal);
        }
      }
      for (Slot& slot : slots_) {
        if (stopped != 0 && slot.waits()) end(slot, MissionState::kInterrupted, "");
      }
      share_out_memory();
    }
    return stopped;
  }

  /// Who came first has it first, and others wait behind it: no mission waits until all smaller ones are done.
  void share_out_memory() {
    std::vector<Slot*> waiting;
    for (Slot& slot : slots_) {
      if (slot.waits()) waiting.push_back(&slot);
    }
    std::sort(waiting.begin(), waiting.end(), [](const Slot* a, const Slot* b) { return a->mission < b->mission; });
    for (Slot* slot : waiting) {
      slot->share = shares_.take(slot->need);
      if (!slot->share) return tell_waiting(*slot);
      run(*slot);
    }
  }

  void start(std::size_t index, BatchMission& mission) {
    Slot& slot = slots_[index];
    slot.mission = &mission;
    MissionStatus& status = mission.status;
    try {
      if (!is_still_to_do(slot, mission)) return slot.free();
      mission.has_run = true;
      status.command = run_words(mission, arguments_, inputs_);
      share_out(index, status.command);
      status.started = time_text();
      status.state = MissionState::kRunning;
      write_status(mission.folder, status);  // first: it says whose folder it is
      if (arguments_.jobs > 1) {
        ask(slot);
      } else {
        run(slot);
      }
    } catch (const std::exception& error) {
      end(slot, MissionState::kFailed, error.what());
    }
  }

  /// In a process of its own: a map that nothing can read costs its mission, not the batch.
  void ask(Slot& slot) {
    std::vector<std::string> words = slot.mission->status.command;
    words.emplace_back("--print-memory");
    slot.step = Slot::Step::kAsks;
    slot.process = start_child(words, log_of(slot.mission->folder));
  }

  /// What could not be told is taken for nothing: the run will say why.
  static void look_at_answer(Slot& slot) {
    slot.step = Slot::Step::kWaits;
    try {
      slot.need = memory_need_from(read_whole_file(log_of(slot.mission->folder)));
    } catch (const IoError&) {  // nobody can read it
    }
  }

  void run(Slot& slot) {
    MissionStatus& status = slot.mission->status;
    try {
      slot.step = Slot::Step::kRuns;
      slot.start = Clock::now();
      slot.process = start_child(status.command, log_of(slot.mission->folder));
    } catch (const std::exception& error) {
      return end(slot, MissionState::kFailed, error.what());
    }
    try {
      status.process = slot.process;
      write_status(slot.mission->folder, status);
    } catch (const std::exception&) {  // it runs; its end will be written
    }
  }

  /// The slot is free again.
  void end(Slot& slot, MissionState state, const std::string& reason) {
    BatchMission& mission = *slot.mission;
    finish(mission, state, reason);
    if (mission.status.state == MissionState::kDone) drop_workspace(mission);
    if (slot.share) shares_.give_back(*slot.share);
    slot.free();
    tell_end(mission);
  }

  void tell_waiting(const Slot& slot) {
    if (slot.mission == told_waiting_) return;
    told_waiting_ = slot.mission;
    progress_.message(slot.mission->mission.name + ": waits until others have given back memory");
  }

  /// Takes its folder. Another process may have made it meanwhile, or may be about to: then nothing is written there.
  bool is_still_to_do(Slot& slot, BatchMission& mission) {
    make_folder(mission.folder);
    mission.has_folder = false;
    slot.lock.emplace(mission.folder, kLockedFolder, kPatience);
    mission.has_folder = true;
    const std::optional<MissionStatus> earlier = read_status(mission.folder);
    if (!earlier) return true;
    if (earlier->state == MissionState::kRunning) wait_for_killed(workspace_of(mission.folder));
    if (!is_settled(*earlier, mission.status, mission)) return true;
    mission.status = *earlier;
    return false;
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
    if (slot.mission == nullptr || slot.waits()) return;
    const std::optional<ChildEnd> its_end = end_of_child(slot.process);
    if (!its_end) return;
    if (slot.step == Slot::Step::kAsks) return look_at_answer(slot);
    BatchMission& mission = *slot.mission;
    MissionStatus& status = mission.status;
    status.process.reset();
    status.exit_code = its_end->exit_code;
    status.signal = its_end->signal;
    status.seconds = seconds_since(slot.start);
    status.peak_memory_mib = its_end->peak_memory_mib;
    const bool is_interrupted = is_stopped && (its_end->signal || *its_end->exit_code > kExitSignal);
    if (its_end->exit_code == kExitOk) {
      status.points = points_in(stats_of(mission.folder));
      end(slot, MissionState::kDone, "");
    } else if (is_interrupted) {
      end(slot, MissionState::kInterrupted, "");
    } else {
      end(slot, MissionState::kFailed, reason_of(*its_end, log_of(mission.folder)));
    }
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
    if (!mission.status.keeps_workspace) fs::remove_all(workspace_of(mission.folder), ignored);
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
    if (!arguments_.only) {  // of all missions
      write_file(file, json_text(json));
      write_file(arguments_.output / "index.html", batch_page(report_, arguments_));
    }
    if (arguments_.progress != ProgressMode::kJson && !arguments_.quiet) {
      std::cout << table_text(report_) << summary(report_) << "\n";
    }
    json.erase("missions");
    if (!arguments_.only) json["output"] = file.string();
    progress_.done(json);
  }

  static constexpr double kGiB = 1024.0 * 1024.0 * 1024.0;
  static constexpr const char* kLockedFolder = "folder of a mission";
  static constexpr std::chrono::seconds kPatience{20};  ///< with a process that has been killed

  const BatchArguments& arguments_;
  Clock::time_point start_ = Clock::now();
  Progress progress_;
  fs::path inputs_;
  BatchReport report_;
  std::vector<Slot> slots_;
  MemoryShares shares_;
  const BatchMission* told_waiting_ = nullptr;
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
  if (!arguments->slurm.empty()) {
    const std::string script = slurm_script(*arguments, read_manifest(arguments->manifest).missions.size());
    if (arguments->slurm == "submit") {
      submit(script);
    } else {
      std::cout << script;
    }
    return kExitOk;
  }
  const int code = Batch(*arguments)();
  std::cout.flush();
  if (!std::cout) throw OutputError("standard output cannot be written");
  return code;
}

}  // namespace pmsp::tool
