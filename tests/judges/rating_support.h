#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>

#include "core/secret.h"
#include "judges/rating_desk.h"
#include "judges/rating_study.h"
#include "tests/reports/stored_run.h"
#include "tests/support/temp_folder.h"

namespace evac {

/// A study of a small run: task take, policy pick@1, worlds real and sim, two clips per initial state.
class SmallStudy {
 public:
  explicit SmallStudy(int states, StudyOptions options = {})
      : run_("run", Letters(states, "sf"), Letters(states, "sffs"), 12) {
    options.runs = {run_.folder()};
    options.height_px = 64;
    made = MakeStudy(folder(), options, [](std::size_t, std::size_t) {});
  }

  std::filesystem::path folder() const { return parent_ / "study"; }
  StudyStore Open() const { return StudyStore::Open(folder(), StudyStore::Mode::kReadWrite); }
  StoredRun& run() { return run_; }

  StudyMade made;

 private:
  static std::string Letters(int count, const std::string& pattern) {
    std::string letters;
    for (int i = 0; i < count; ++i) letters += pattern[static_cast<std::size_t>(i) % pattern.size()];
    return letters;
  }

  TempFolder parent_;
  StoredRun run_;
};

/// One person at the desk, who watches everything and says what a test wants.
class AtTheDesk {
 public:
  AtTheDesk(StudyStore& store, RatingDesk& desk, RaterRole role = RaterRole::kRater) : store_(store), desk_(desk) {
    link = NewSecret();
    store_.AddInvite(link, role, now_ms);
    uuid = NewSecret();
    session = desk_.Join({link, uuid, "Ann"}, now_ms).session;
    id = store_.RaterOfSession(session)->id;
    TakeTab();
  }

  StudyRater Me() const { return store_.Rater(id); }
  void TakeTab() { epoch = desk_.TakeTab(Me()).body.at("tab_epoch"); }
  DeskAnswer Next(std::vector<std::string> held = {}) { return desk_.Next(Me(), {epoch, std::move(held)}, now_ms); }

  HumanVerdict Watched(const std::string& presentation, const std::string& label) const {
    HumanVerdict verdict;
    verdict.client_uuid = NewSecret();
    verdict.presentation = presentation;
    verdict.label = label;
    verdict.coverage = 1;
    verdict.rt_ms = 9000;
    verdict.tab_epoch = epoch;
    verdict.ua_hash = "browser";
    return verdict;
  }
  DeskAnswer Say(const HumanVerdict& verdict) { return desk_.Submit(Me(), verdict, now_ms); }
  DeskAnswer Say(const std::string& presentation, const std::string& label) {
    return Say(Watched(presentation, label));
  }

  /// Rates whatever comes until there is nothing left. @returns how many.
  template <typename LabelOf>
  int RateAll(const LabelOf& label_of) {
    for (int count = 0;; ++count) {
      const DeskAnswer next = Next();
      if (next.body.contains("done")) return count;
      const std::string presentation = next.body.at("presentation");
      Say(presentation, label_of(store_.Clip(store_.FindPresentation(presentation)->clip)));
    }
  }

  std::string link, uuid, session;
  std::int64_t id = 0, epoch = 0, now_ms = 1'000'000;

 private:
  StudyStore& store_;
  RatingDesk& desk_;
};

}  // namespace evac
