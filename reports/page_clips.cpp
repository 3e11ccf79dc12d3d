#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "reports/html.h"
#include "reports/page_parts.h"

namespace evac {
namespace {

std::string Choice(const char* name) {
  return fmt::format("<label>{0}<select name=\"{0}\"><option value=\"\">all</option></select></label>", name);
}

}  // namespace

std::string ClipsPart(const RunSummary& summary) {
  std::string html = "<section id=\"clips\"><h2>Clips</h2>";
  if (summary.episodes.empty()) html += "<p>The run holds no episodes yet.</p>";
  html +=
      "<noscript><p>The clip browser needs script. Without it, <code>verdicts.csv</code> beside this page lists every "
      "episode with its video, and flips are listed state by state above.</p></noscript>";
  html += "<form class=\"filters\" hidden>" + Choice("task") + Choice("policy") + Choice("world") + Choice("outcome") +
          Choice("reason");
  html +=
      "<label>text<input type=\"search\" name=\"text\" size=\"12\"></label><label class=\"check\"><input "
      "type=\"checkbox\" name=\"flips\"> flipped</label><button type=\"reset\">Reset</button><output "
      "aria-live=\"polite\"></output></form>";
  return html +
         "<div class=\"browser\" role=\"list\" aria-label=\"Clips; arrow keys move, Enter opens\" "
         "hidden></div></section>";
}

std::string ShowClips(const std::string& task, const std::string& policy, const std::string& world) {
  nlohmann::ordered_json filters = nlohmann::ordered_json::object();
  if (!task.empty()) filters["task"] = task;
  if (!policy.empty()) filters["policy"] = policy;
  if (!world.empty()) filters["world"] = world;
  return Escaped(filters.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

}  // namespace evac
