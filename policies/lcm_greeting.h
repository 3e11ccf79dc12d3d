#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "core/store.h"
#include "policies/lcm_link.h"
#include "policies/spec.h"

namespace evac {

/// The harness's half of the handshake: says hello until exactly one policy declares itself.
struct LcmGreeting {
  LcmLink& link;
  const LcmAddress& address;
  std::string client;
  std::function<std::optional<std::string>()> why_gone;  ///< asked while waiting; may be empty
  std::function<bool()> interrupted;                     ///< the same
  const Counters& counters;                              ///< undecodable_replies explains a silence
  std::string who{}, if_silent{};                        ///< as in LcmPolicyOptions

  /// @param declarations  by server; filled by whoever handles the link's messages.
  /// @returns the one policy's declaration.
  /// @throws InvalidInput, beginning with `who`, if nobody answers within `wait_s`, the policy is gone, or two answer.
  spec_t Await(const PolicySpec& harness, double wait_s, std::map<std::string, declaration_t>& declarations) const;

  /// Asks for declarations, once.
  void SayHello(const PolicySpec& harness) const;

 private:
  void RefuseTwoPolicies(const PolicySpec& harness, std::map<std::string, declaration_t>& declarations) const;
  [[noreturn]] void ThrowNobodyAnswers(double wait_s) const;
};

}  // namespace evac
