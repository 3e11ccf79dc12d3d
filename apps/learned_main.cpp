#include "apps/policy_program.h"
#include "policies/learned_policy.h"

/// `evac-policy learned`, the one policy that is a network (apps/policy_main.cpp starts it).
int main(int argc, char** argv) {
  CLI::App app("Does what it learned by imitation (evac train policy).", "evac-policy learned");
  std::string weights, as_task;
  evac::LcmAddress address;
  int chunk_size = 8;
  app.add_option("--checkpoint", weights, "weights with their card, as `evac train policy` writes them")->required();
  app.add_option("--chunk-size", chunk_size, "targets per chunk, of the 16 that it says at once")
      ->envname("EVAC_CHUNK_SIZE")
      ->capture_default_str();
  app.add_option("--task", as_task,
                 "act as in this task of the training, whatever the suite's is called (a recording's is named after it)");
  evac::AddAddressOptions(app, address);
  app.footer(
      "Example:\n  evac-policy learned --checkpoint out/policy/policy.safetensors\nHow it is trained and how good it "
      "is: docs/learned_policy.md");
  int exit_code = 0;
  app.callback([&] {
    evac::LearnedPolicy policy(weights, chunk_size, as_task);
    exit_code = ServePolicy(policy, policy.Spec(), address);
  });
  return evac::RunPolicyProgram(app, argc, argv, exit_code);
}
