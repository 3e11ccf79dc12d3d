#include "policies/lcm_greeting.h"

#include <fmt/format.h>

#include <chrono>
#include <iterator>

#include "core/error.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kBetweenHellos_s = 0.1;

Clock::time_point In(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

std::string Before(const std::string& who) { return who.empty() ? "" : who + ": "; }

}  // namespace

spec_t LcmGreeting::Await(const PolicySpec& harness, double wait_s,
                          std::map<std::string, declaration_t>& declarations) const {
  const Clock::time_point end = In(wait_s);
  declarations.clear();
  while (declarations.empty()) {
    if (Clock::now() > end) ThrowNobodyAnswers(wait_s);
    if (interrupted && interrupted()) throw InternalError("interrupted while the policy was starting");
    if (const auto why = why_gone ? why_gone() : std::nullopt)
      throw InvalidInput("{}the policy is gone before it declared itself: {}", Before(who), *why);
    SayHello(harness);
    link.Handle(kBetweenHellos_s);
  }
  RefuseTwoPolicies(harness, declarations);
  return declarations.begin()->second.policy;
}

void LcmGreeting::SayHello(const PolicySpec& harness) const {
  hello_t hello;
  hello.harness = ToWire(harness);
  hello.client = client;
  link.Publish(address.Channel("hello"), hello);
}

/// One who died while greeting may have answered too; who answers a second greeting is alive.
void LcmGreeting::RefuseTwoPolicies(const PolicySpec& harness,
                                    std::map<std::string, declaration_t>& declarations) const {
  const declaration_t first = declarations.begin()->second;
  declarations.clear();
  SayHello(harness);
  for (const auto end = In(kBetweenHellos_s); Clock::now() < end;) link.Handle(kBetweenHellos_s / 10);
  if (declarations.empty()) declarations[first.server] = first;
  if (declarations.size() == 1) return;
  throw InvalidInput(
      "{}{} policies answer on {} with token {} ({}, {} …): stop all but one, or give each a token of its own",
      Before(who), declarations.size(), address.url, address.token, declarations.begin()->second.policy.name,
      std::next(declarations.begin())->second.policy.name);
}

void LcmGreeting::ThrowNobodyAnswers(double wait_s) const {
  const auto found = counters.find("undecodable_replies");
  const std::string hint =
      found == counters.end() ? ""
                              : fmt::format("; {} answers came in another version of the message types", found->second);
  const std::string help = if_silent.empty() ? ". One that runs elsewhere joins with these as EVAC_LCM_URL and EVAC_TOKEN, "
                                               "or as --url and --token"
                                             : "; " + if_silent;
  throw InvalidInput("{}no policy answered within {} s on {} with token {}{}{}", Before(who), wait_s, address.url,
                     address.token, hint, help);
}

}  // namespace evac
