#include <fmt/format.h>

#include "core/secret.h"
#include "judges/rating_desk.h"

/// What raters say, and take back (docs/rating_session.md).
namespace evac {

using Json = nlohmann::ordered_json;

namespace {

DeskAnswer Refused(int status, const char* error, const std::string& sentence) {
  return {status, {{"error", error}, {"message", sentence}}};
}

Json StagesOf(int bits) {
  Json stages = Json::array();
  for (int k = 0; k < kMostStages; ++k) {
    if (bits >> k & 1) stages.push_back(k);
  }
  return stages;
}

Json VerdictJson(const HumanVerdict& verdict) {
  return {{"id", verdict.id},
          {"client_uuid", verdict.client_uuid},
          {"presentation", verdict.presentation},
          {"label", verdict.label},
          {"stages", verdict.stages},
          {"flags", verdict.flags},
          {"cause", verdict.cause},
          {"note", verdict.note},
          {"confidence", verdict.confidence ? Json(*verdict.confidence) : Json(nullptr)},
          {"is_final", verdict.is_final}};
}

}  // namespace

DeskAnswer RatingDesk::Stored(const StudyRater& rater, const HumanVerdict& verdict, std::int64_t now_ms) const {
  DeskAnswer answer;
  answer.body = {{"verdict", VerdictJson(verdict)}};
  const auto p = store_.FindPresentation(verdict.presentation);
  if (p && p->showing == Showing::kPractice) {
    const StudyClip clip = store_.Clip(p->clip);
    answer.body["feedback"] = {{"label", clip.reference ? Name(*clip.reference) : "cannot_tell"},
                               {"reason", clip.reference_reason}};
  }
  if (p && p->showing == Showing::kAdjudication) answer.body["others"] = Others(p->clip);
  answer.body["progress"] = Progress(rater, now_ms);
  return answer;
}

Json RatingDesk::Others(std::int64_t clip) const {
  Json others = Json::array();
  for (const StudyStore::Said& said : store_.CurrentOf(clip)) {
    const bool is_vote = said.counts && (said.showing == Showing::kCounted || said.showing == Showing::kGold ||
                                         said.showing == Showing::kImport);
    if (!is_vote) continue;
    others.push_back({{"rater", fmt::format("r{}", said.verdict.rater)},
                      {"label", said.verdict.label},
                      {"stages", StagesOf(said.verdict.stages)},
                      {"flags", said.verdict.flags},
                      {"cause", said.verdict.cause},
                      {"note", said.verdict.note}});
  }
  return others;
}

/// Whether what is said fits to what was said before; fills in what it supersedes.
std::optional<DeskAnswer> RatingDesk::WhyNotAgain(const Presentation& p, HumanVerdict& verdict) const {
  const auto last = store_.LastVerdict(p.id);
  const bool is_answered = last && last->label != "retracted";
  if (!is_answered && verdict.supersedes) return Refused(409, "superseded", "there is no such verdict to replace");
  if (!is_answered && verdict.is_final) return Refused(409, "blind", "say what you see before you decide");
  if (!is_answered) {
    if (last) verdict.supersedes = last->id;
    return std::nullopt;
  }
  if (!verdict.supersedes || *verdict.supersedes != last->id) {
    DeskAnswer answer = Refused(409, "answered", "this clip has another verdict of yours");
    answer.body["verdict"] = VerdictJson(*last);
    return answer;
  }
  if (p.showing == Showing::kPractice) return Refused(409, "practice", "practice is answered once");
  if (p.showing == Showing::kAdjudication && !verdict.is_final)
    return Refused(409, "blind", "after the others' verdicts were shown only the decision is left");
  return std::nullopt;
}

DeskAnswer RatingDesk::Submit(const StudyRater& rater, HumanVerdict verdict, std::int64_t now_ms) {
  if (const auto stored = store_.VerdictByUuid(verdict.client_uuid)) {
    if (stored->rater != rater.id) return Refused(409, "uuid", "this uuid is taken");
    return Stored(rater, *stored, now_ms);
  }
  const auto p = store_.FindPresentation(verdict.presentation);
  if (!p || p->rater != rater.id || !p->shown_ms || p->showing == Showing::kExample)
    return Refused(404, "clip", "there is no such clip");
  if (verdict.tab_epoch != rater.tab_epoch) return Refused(409, "tab", "this study is open in another tab");
  if (verdict.is_final && p->showing != Showing::kAdjudication)
    return Refused(403, "role", "only an adjudicator decides");
  const bool is_change = verdict.supersedes.has_value();  // or the decision: the clip was watched for the first word
  if (auto refusal = WhyNotAgain(*p, verdict)) return *refusal;
  if (!is_change && verdict.coverage < options_.cover_share - 1e-6)
    return Refused(422, "coverage",
                   fmt::format("coverage: found {:.3f}, wanted {} or more", verdict.coverage, options_.cover_share));
  verdict.created_ms = now_ms;
  verdict.app_version = options_.app_version;
  const HumanVerdict stored = store_.AddVerdict(std::move(verdict));
  if (p->showing != Showing::kAdjudication || stored.is_final) {
    store_.SetState(p->id, "answered");
    store_.Lease(p->id, 0, now_ms);
  }
  return Stored(rater, stored, now_ms);
}

DeskAnswer RatingDesk::Retract(const StudyRater& rater, const RetractBody& body, std::int64_t now_ms) {
  if (const auto stored = store_.VerdictByUuid(body.uuid)) {
    if (stored->rater != rater.id) return Refused(409, "uuid", "this uuid is taken");
    return Stored(rater, *stored, now_ms);
  }
  const auto target = store_.VerdictByUuid(body.of_uuid);
  if (!target || target->rater != rater.id) return Refused(404, "verdict", "there is no such verdict");
  if (body.tab_epoch != rater.tab_epoch) return Refused(409, "tab", "this study is open in another tab");
  const auto current = store_.CurrentVerdict(target->presentation);
  if (!current || current->id != target->id) return Refused(409, "superseded", "it was replaced already");
  const auto p = store_.FindPresentation(target->presentation);
  if (p->showing == Showing::kPractice || p->showing == Showing::kAdjudication)
    return Refused(409, "practice", "only a rating can be undone");
  HumanVerdict row;
  row.client_uuid = body.uuid;
  row.presentation = target->presentation;
  row.supersedes = target->id;
  row.label = "retracted";
  row.created_ms = now_ms;
  row.tab_epoch = body.tab_epoch;
  row.app_version = options_.app_version;
  const HumanVerdict stored = store_.AddVerdict(std::move(row));
  store_.SetState(p->id, "open");
  store_.Lease(p->id, now_ms + options_.lease_ms, now_ms);
  return Stored(rater, stored, now_ms);
}

DeskAnswer RatingDesk::Unplayable(const StudyRater& rater, const PresentationBody& body, std::int64_t now_ms) {
  const auto p = store_.FindPresentation(body.presentation);
  if (!p || p->rater != rater.id || !p->shown_ms) return Refused(404, "clip", "there is no such clip");
  if (body.tab_epoch != rater.tab_epoch) return Refused(409, "tab", "this study is open in another tab");
  if (p->state == "open") {
    store_.SetState(p->id, "unplayable");
    store_.Lease(p->id, 0, now_ms);
    store_.AddEvent(rater.id, "unplayable", p->id + " " + body.reason, now_ms);
  }
  return {200, {{"progress", Progress(rater, now_ms)}}};
}

DeskAnswer RatingDesk::Withdraw(const StudyRater& rater, const WithdrawBody& body, std::int64_t now_ms) {
  store_.Withdraw(rater.id, body.keep, body.erase, now_ms);
  return {200, {{"withdrawn", true}}};
}

DeskAnswer RatingDesk::History(const StudyRater& rater) const {
  constexpr std::size_t kMost = 60;
  Json verdicts = Json::array();
  const auto said = store_.CurrentBy(rater.id);
  for (auto one = said.rbegin(); one != said.rend() && verdicts.size() < kMost; ++one) {
    if (one->showing == Showing::kPractice) continue;
    verdicts.push_back(VerdictJson(one->verdict));
    verdicts.back()["created_ms"] = one->verdict.created_ms;
  }
  return {200, {{"verdicts", verdicts}}};
}

DeskAnswer RatingDesk::Mine(const StudyRater& rater) const {
  const StudyTable table = store_.VerdictTableOf(rater.id);
  Json rows = Json::array();
  for (const auto& cells : table.rows) {
    Json row = Json::object();
    for (std::size_t i = 0; i < cells.size(); ++i) row[table.columns[i]] = cells[i];
    rows.push_back(std::move(row));
  }
  return {200,
          {{"rater", fmt::format("r{}", rater.id)}, {"name", rater.name}, {"study", info_.name}, {"verdicts", rows}}};
}

}  // namespace evac
