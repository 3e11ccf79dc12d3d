#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/store_study.h"
#include "judges/rating_words.h"

namespace evac {

struct DeskOptions {
  double cover_share = 0.9;         ///< of a clip must have been on the screen before its verdict
  std::int64_t lease_ms = 600'000;  ///< how long a clip given out counts as a vote to come
  int break_every = 20;             ///< verdicts, then a pause is offered
  double repeat_share = 0.05;       ///< of the clips are shown to each rater again
  int min_repeats = 10;             ///< but never more than an eighth of the clips
  double guess_share = 0.1;         ///< of the rated clips: "generated or recorded?"
  std::string app_version = {};
};

/// What the desk says: 200, or why not. 403 not yours, 404 not there, 409 somebody was earlier, 410 used, 422 not so.
struct DeskAnswer {
  int status = 200;
  nlohmann::ordered_json body = nlohmann::ordered_json::object();
  std::string session = {};  ///< of Join: the secret that the browser keeps
};

/// The rules of a rating session (docs/rating_session.md) over a study's store, without any network. Every call is one
/// change that the caller commits before the answer leaves. Nothing it answers a rater tells policy, world or seed.
class RatingDesk {
 public:
  RatingDesk(StudyStore& store, DeskOptions options);

  /// A free link makes a rater with an order of their own. The same link with the same uuid (a lost answer) gives
  /// another session of the same rater; with another uuid it is used (410).
  DeskAnswer Join(const JoinBody& body, std::int64_t now_ms);
  /// Who, which study, how far; makes the order for clips that came since.
  DeskAnswer Me(const StudyRater& rater, std::int64_t now_ms);
  /// This tab writes from now on; every other one gets 409 "tab".
  DeskAnswer TakeTab(const StudyRater& rater);

  /// The next clip, leased; {"done": true} if there is none. An adjudicator gets disputes, while there are others none
  /// that another one has under a lease.
  DeskAnswer Next(const StudyRater& rater, const NextBody& body, std::int64_t now_ms);
  /// A clip that was shown before, to change its verdict.
  DeskAnswer Open(const StudyRater& rater, const PresentationBody& body, std::int64_t now_ms);
  DeskAnswer Heartbeat(const StudyRater& rater, const PresentationBody& body, std::int64_t now_ms);

  /// The same uuid again gets the stored row (200) and changes nothing; another one for an answered clip gets 409 with
  /// the stored verdict, unless it supersedes just that.
  DeskAnswer Submit(const StudyRater& rater, HumanVerdict verdict, std::int64_t now_ms);
  DeskAnswer Retract(const StudyRater& rater, const RetractBody& body, std::int64_t now_ms);
  DeskAnswer Unplayable(const StudyRater& rater, const PresentationBody& body, std::int64_t now_ms);
  DeskAnswer Guess(const StudyRater& rater, const GuessBody& body, std::int64_t now_ms);
  DeskAnswer Withdraw(const StudyRater& rater, const WithdrawBody& body, std::int64_t now_ms);

  /// Clips with their labels, for the brief.
  DeskAnswer Examples(const StudyRater& rater) const;
  /// What this rater said, newest first.
  DeskAnswer History(const StudyRater& rater) const;
  /// The clips whose origin is to be guessed.
  DeskAnswer ToGuess(const StudyRater& rater) const;
  /// All that is stored of this rater.
  DeskAnswer Mine(const StudyRater& rater) const;

  /// The video of a presentation that was shown to this rater; nothing for any other.
  std::optional<std::filesystem::path> ClipFile(const StudyRater& rater, const std::string& presentation) const;

 private:
  void Plan(const StudyRater& rater, std::int64_t now_ms);
  DeskAnswer Shown(const StudyRater& rater, const Presentation& presentation, std::int64_t now_ms) const;
  DeskAnswer NextDispute(const StudyRater& rater, const NextBody& body, std::int64_t now_ms);
  std::optional<DeskAnswer> WhyNotAgain(const Presentation& presentation, HumanVerdict& verdict) const;
  std::int64_t DisputesLeft(const StudyRater& rater) const;
  DeskAnswer Stored(const StudyRater& rater, const HumanVerdict& verdict, std::int64_t now_ms) const;
  nlohmann::ordered_json Progress(const StudyRater& rater, std::int64_t now_ms) const;
  nlohmann::ordered_json Others(std::int64_t clip) const;

  StudyStore& store_;
  DeskOptions options_;
  StudyInfo info_;
};

}  // namespace evac
