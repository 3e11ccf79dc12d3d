#include "judges/rating_desk.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/secret.h"
#include "core/seed.h"
#include "judges/rating_order.h"

namespace evac {

using Json = nlohmann::ordered_json;

namespace {

DeskAnswer Refused(int status, const char* error, const std::string& sentence) {
  return {status, {{"error", error}, {"message", sentence}}};
}

DeskAnswer OldTab() { return Refused(409, "tab", "this study is open in another tab"); }

std::string PublicName(const StudyRater& rater) { return fmt::format("r{}", rater.id); }

/// Clips that other adjudicators have before them.
std::set<std::int64_t> DecidedOnByOthers(const StudyStore& store, const StudyRater& rater, std::int64_t now_ms) {
  std::set<std::int64_t> clips;
  for (const Presentation& p : store.Leases(now_ms)) {
    if (p.rater != rater.id && p.showing == Showing::kAdjudication) clips.insert(p.clip);
  }
  return clips;
}

/// Hands out places one after the other.
class OrderWriter {
 public:
  OrderWriter(const StudyRater& rater, int next) : rater_(rater.id), next_(next) {}

  void Add(const StudyClip& clip, Showing showing, std::int64_t now_ms) {
    Presentation p = New(clip.id, showing);
    if (showing == Showing::kExample) p.state = "answered", p.shown_ms = now_ms;
    if (showing != Showing::kRepeat)
      first_[clip.id] = p.id;
    else
      p.repeat_of = first_.at(clip.id);
    presentations.push_back(std::move(p));
  }

  std::vector<Presentation> presentations;

 private:
  Presentation New(std::int64_t clip, Showing showing) {
    Presentation p;
    p.id = NewSecret();
    p.rater = rater_;
    p.clip = clip;
    p.order_index = next_++;
    p.showing = showing;
    return p;
  }

  std::int64_t rater_;
  int next_;
  std::map<std::int64_t, std::string> first_;
};

}  // namespace

RatingDesk::RatingDesk(StudyStore& store, DeskOptions options)
    : store_(store), options_(std::move(options)), info_(store.info()) {}

DeskAnswer RatingDesk::Join(const JoinBody& body, std::int64_t now_ms) {
  const auto invite = store_.FindInvite(body.invite);
  if (!invite) return Refused(404, "link", "this link is not known");
  if (invite->used_by && !SameSecret(invite->used_uuid, body.uuid))
    return Refused(410, "used", "this link was used; ask for another one");
  const StudyRater rater =
      invite->used_by ? store_.Rater(*invite->used_by) : store_.Join(body.invite, body.uuid, body.name, now_ms);
  if (rater.status != "active") return Refused(410, "used", "this link was used; ask for another one");
  DeskAnswer answer;
  answer.session = NewSecret();
  store_.AddSession(rater.id, answer.session, now_ms);
  if (!invite->used_by) Plan(rater, now_ms);
  answer.body = {{"rater", PublicName(rater)}, {"role", Name(rater.role)}};
  return answer;
}

/// Examples and practice first, then the rest in this rater's order, some of it twice.
void RatingDesk::Plan(const StudyRater& rater, std::int64_t now_ms) {
  if (rater.role != RaterRole::kRater) return;
  std::set<std::int64_t> planned;
  int next = 0;
  for (const Presentation& p : store_.PresentationsOf(rater.id)) planned.insert(p.clip), next = p.order_index + 1;
  std::vector<StudyClip> clips = store_.Clips();
  std::erase_if(clips, [&](const StudyClip& clip) { return planned.contains(clip.id); });
  if (clips.empty()) return;
  OrderWriter writer(rater, next);
  std::vector<StudyClip> rated;
  std::vector<OrderedClip> ordered;
  const std::map<std::int64_t, std::int64_t> votes = store_.Votes();
  for (const StudyClip& clip : clips) {
    if (clip.use == Showing::kExample || clip.use == Showing::kPractice) {
      writer.Add(clip, clip.use, now_ms);
      continue;
    }
    rated.push_back(clip);
    const auto of_clip = votes.find(clip.id);
    ordered.push_back({clip.task + "\n" + clip.initial_state, clip.world + "\n" + clip.policy + "@" + clip.checkpoint,
                       of_clip == votes.end() ? 0 : of_clip->second});
  }
  const auto share = static_cast<std::size_t>(std::lround(options_.repeat_share * static_cast<double>(rated.size())));
  const std::size_t repeats =
      std::min(std::max(share, static_cast<std::size_t>(options_.min_repeats)), rated.size() / 8);
  const auto who = static_cast<std::uint64_t>(rater.id);
  for (const Place& place : WithRepeats(info_.seed, who, OrderFor(info_.seed, who, ordered), repeats)) {
    const StudyClip& clip = rated[place.clip];
    writer.Add(clip, place.is_repeat ? Showing::kRepeat : clip.use, now_ms);
  }
  store_.AddPresentations(writer.presentations);
}

Json RatingDesk::Progress(const StudyRater& rater, std::int64_t now_ms) const {
  StudyStore::Progress progress = store_.ProgressOf(rater.id, now_ms);
  if (rater.role == RaterRole::kAdjudicator) progress.total = progress.done + DisputesLeft(rater);
  return {{"done", progress.done}, {"total", progress.total}, {"practice_left", progress.practice_left}};
}

DeskAnswer RatingDesk::Me(const StudyRater& rater, std::int64_t now_ms) {
  Plan(rater, now_ms);
  DeskAnswer answer;
  answer.body = {{"rater", PublicName(rater)}, {"role", Name(rater.role)},      {"name", rater.name},
                 {"study", info_.name},        {"cover", options_.cover_share}, {"break_every", options_.break_every},
                 {"period_s", info_.period_s}, {"width_px", info_.width_px},    {"height_px", info_.height_px},
                 {"flags", RatingFlags()},     {"causes", FailureCauses()},     {"progress", Progress(rater, now_ms)}};
  Json rubrics = Json::array();
  for (const StudyRubric& rubric : store_.Rubrics()) rubrics.push_back(Json::parse(rubric.document));
  answer.body["rubrics"] = std::move(rubrics);
  return answer;
}

DeskAnswer RatingDesk::TakeTab(const StudyRater& rater) { return {200, {{"tab_epoch", store_.NextTab(rater.id)}}}; }

/// What the browser needs to show a clip. Gold and repeats look like any other.
DeskAnswer RatingDesk::Shown(const StudyRater& rater, const Presentation& p, std::int64_t now_ms) const {
  const StudyClip clip = store_.Clip(p.clip);
  std::string document = "{}";
  for (const StudyRubric& rubric : store_.Rubrics()) {
    if (rubric.hash == clip.rubric_hash) document = rubric.document;
  }
  const bool is_practice = p.showing == Showing::kPractice, is_dispute = p.showing == Showing::kAdjudication;
  DeskAnswer answer;
  answer.body = {{"presentation", p.id},
                 {"kind", is_practice  ? "practice"
                          : is_dispute ? "adjudication"
                                       : "clip"},
                 {"number", p.order_index + 1},
                 {"frames", clip.frames},
                 {"period_s", info_.period_s},
                 {"views", Json::parse(clip.views)},
                 {"rubric", Json::parse(document)},
                 {"progress", Progress(rater, now_ms)}};
  if (const auto current = store_.CurrentVerdict(p.id)) {
    answer.body["verdict"] = Stored(rater, *current, now_ms).body["verdict"];
    if (is_dispute) answer.body["others"] = Others(p.clip);
  }
  return answer;
}

DeskAnswer RatingDesk::Next(const StudyRater& rater, const NextBody& body, std::int64_t now_ms) {
  if (body.tab_epoch != rater.tab_epoch) return OldTab();
  if (rater.role == RaterRole::kAdjudicator) return NextDispute(rater, body, now_ms);
  if (rater.role == RaterRole::kLead) return Refused(403, "role", "a lead rates no clips");
  const auto next = store_.NextOpen(rater.id, body.held, now_ms);
  if (!next) return {200, {{"done", true}, {"progress", Progress(rater, now_ms)}}};
  store_.Lease(next->id, now_ms + options_.lease_ms, now_ms);
  return Shown(rater, *next, now_ms);
}

DeskAnswer RatingDesk::Open(const StudyRater& rater, const PresentationBody& body, std::int64_t now_ms) {
  if (body.tab_epoch != rater.tab_epoch) return OldTab();
  const auto p = store_.FindPresentation(body.presentation);
  if (!p || p->rater != rater.id || !p->shown_ms || p->showing == Showing::kExample)
    return Refused(404, "clip", "there is no such clip");
  if (p->state == "open") store_.Lease(p->id, now_ms + options_.lease_ms, now_ms);
  return Shown(rater, *p, now_ms);
}

/// The one that was begun goes on; then come those that nobody has before them. The later of two words holds: a clip is
/// two adjudicators' only where no other is left.
DeskAnswer RatingDesk::NextDispute(const StudyRater& rater, const NextBody& body, std::int64_t now_ms) {
  std::map<std::int64_t, Presentation> mine;
  int next = 0;
  for (Presentation& p : store_.PresentationsOf(rater.id)) next = p.order_index + 1, mine[p.clip] = std::move(p);
  std::vector<std::int64_t> disputes = store_.Disputes();
  const std::set<std::int64_t> taken = DecidedOnByOthers(store_, rater, now_ms);
  std::ranges::stable_sort(disputes, {}, [&](std::int64_t clip) {
    const auto own = mine.find(clip);
    const bool is_begun = own != mine.end() && own->second.shown_ms;
    if (is_begun && (own->second.lease_until_ms > now_ms || !taken.contains(clip))) return 0;
    return taken.contains(clip) ? 2 : 1;
  });
  for (const std::int64_t clip : disputes) {
    auto found = mine.find(clip);
    if (found == mine.end()) {
      Presentation p;
      p.id = NewSecret();
      p.rater = rater.id;
      p.clip = clip;
      p.order_index = next;
      p.showing = Showing::kAdjudication;
      store_.AddPresentations({&p, 1});
      found = mine.emplace(clip, std::move(p)).first;
    }
    if (found->second.state != "open" || std::ranges::find(body.held, found->second.id) != body.held.end()) continue;
    store_.Lease(found->second.id, now_ms + options_.lease_ms, now_ms);
    DeskAnswer answer = Shown(rater, found->second, now_ms);
    answer.body["left"] = disputes.size();
    return answer;
  }
  return {200, {{"done", true}, {"progress", Progress(rater, now_ms)}}};
}

/// How many clips wait for this adjudicator: those that they decided or cannot play do not.
std::int64_t RatingDesk::DisputesLeft(const StudyRater& rater) const {
  std::set<std::int64_t> over;
  for (const Presentation& p : store_.PresentationsOf(rater.id)) {
    if (p.state != "open") over.insert(p.clip);
  }
  return std::ranges::count_if(store_.Disputes(), [&over](std::int64_t clip) { return !over.contains(clip); });
}

DeskAnswer RatingDesk::Heartbeat(const StudyRater& rater, const PresentationBody& body, std::int64_t now_ms) {
  if (body.tab_epoch != rater.tab_epoch) return OldTab();
  const auto p = store_.FindPresentation(body.presentation);
  if (!p || p->rater != rater.id || !p->shown_ms) return Refused(404, "clip", "there is no such clip");
  if (p->state == "open") store_.Lease(p->id, now_ms + options_.lease_ms, now_ms);
  return {};
}

DeskAnswer RatingDesk::Examples(const StudyRater& rater) const {
  Json examples = Json::array();
  for (const Presentation& p : store_.PresentationsOf(rater.id)) {
    if (p.showing != Showing::kExample) continue;
    const StudyClip clip = store_.Clip(p.clip);
    examples.push_back({{"presentation", p.id},
                        {"instruction", ""},
                        {"label", clip.reference ? Name(*clip.reference) : "cannot_tell"},
                        {"reason", clip.reference_reason},
                        {"views", Json::parse(clip.views)}});
    for (const StudyRubric& rubric : store_.Rubrics()) {
      if (rubric.hash == clip.rubric_hash)
        examples.back()["instruction"] = Json::parse(rubric.document).value("instruction", "");
    }
  }
  return {200, {{"examples", examples}}};
}

DeskAnswer RatingDesk::ToGuess(const StudyRater& rater) const {
  std::set<std::int64_t> guessed;
  for (const StudyStore::Guess& guess : store_.Guesses()) {
    if (guess.rater == rater.id) guessed.insert(guess.clip);
  }
  std::vector<Presentation> rated;
  for (Presentation& p : store_.PresentationsOf(rater.id)) {
    const bool is_asked = p.showing == Showing::kCounted || p.showing == Showing::kGold;
    if (is_asked && p.state == "answered") rated.push_back(std::move(p));
  }
  std::ranges::sort(rated, {}, [&](const Presentation& p) {
    return SplitMix64(SeedFor(SeedFor(info_.seed, "guesses"), static_cast<std::uint64_t>(p.clip * 1000 + rater.id)))
        .Next();
  });
  rated.resize(static_cast<std::size_t>(std::ceil(options_.guess_share * static_cast<double>(rated.size()))));
  Json clips = Json::array();
  for (const Presentation& p : rated) {
    if (!guessed.contains(p.clip)) clips.push_back({{"presentation", p.id}});
  }
  return {200, {{"clips", clips}}};
}

DeskAnswer RatingDesk::Guess(const StudyRater& rater, const GuessBody& body, std::int64_t now_ms) {
  const auto p = store_.FindPresentation(body.presentation);
  if (!p || p->rater != rater.id || p->state != "answered" || p->showing == Showing::kExample)
    return Refused(404, "clip", "there is no such clip");
  store_.AddGuess(rater.id, p->clip, body.guess, now_ms);
  return {};
}

std::optional<std::filesystem::path> RatingDesk::ClipFile(const StudyRater& rater,
                                                          const std::string& presentation) const {
  if (!IsSecret(presentation)) return std::nullopt;
  const auto p = store_.FindPresentation(presentation);
  if (!p || p->rater != rater.id || !p->shown_ms) return std::nullopt;
  return store_.folder() / store_.Clip(p->clip).file;
}

}  // namespace evac
