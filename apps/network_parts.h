#pragma once

#include <filesystem>
#include <memory>

#include "core/judge.h"
#include "core/policy.h"
#include "core/recording.h"
#include "core/store.h"
#include "core/world.h"
#include "harness/suite.h"
#include "judges/rating_clip.h"

/// The parts of `evac` that are networks, and with them libtorch, which takes half a second of a core to load. There
/// are two of each, and the linker chooses: the program `evac-networks` has them (apps/networks); the program `evac`
/// becomes evac-networks, with the same command line, where one is asked for (apps/networks_beside.cpp), and starts at
/// once where none is. docs/decisions/0042.
namespace evac {

/// For what is known to need a network, before anything was opened or written. Returns in evac-networks alone.
void NeedNetworks();

/// NeedNetworks() if a world of the suite is one.
void NeedNetworksFor(const Suite& suite);

/// The world of a suite's entry of type `evac`: its network loaded, its chunk cache opened.
/// @param store  where the real run's first frames are; null: nobody has run it, and only a recording can be started
/// from
/// @throws InvalidInput if page and weights are not of one network, either is broken, or one of the files is another
/// than when the suite was read (DemandUnchanged).
std::unique_ptr<World> MakeEvacWorld(const SuiteWorld& world, const Suite& suite, const Store* store);

/// The same without loading it: what is wrong with page and weights is known before the first episode of any world, and
/// whether weights that say what they were trained for (worldmodel/trained_for.h) are asked for something else: another
/// period, other cameras or arms than `tasks` have, other statistics, other pose maps.
void CheckNetwork(const SuiteWorld& world, const std::vector<Task>& tasks);

/// Error::kind of what is wrong with a suite whichever recording it is asked about.
inline constexpr const char* kSuiteError = "suite";

/// A recording of a suite with a world of type `evac`, as its network was trained to see one: in steps of the world's
/// period, by the cameras that the weights say, or by as many as the network has views, the head first: others are not
/// looked at, and may be broken.
/// @throws InvalidInput if its steps are no whole part of that period; if a camera is missing; called kSuiteError, which
///   is no recording's fault: if two of the suite's networks want it otherwise (what each wants), or one of them another
///   period than the suite says.
Recording ReadAsTrained(const Suite& suite, const std::filesystem::path& folder);

/// The classifier judge of a run. @throws InvalidInput if the weights are none of its, or do not know the run's tasks.
std::unique_ptr<Judge> MakeClassifier(const std::filesystem::path& weights, const Store& store);

/// A policy that learned, in this process instead of one of its own. From then on each thread of
/// this process that asks for one works alone: many record at the same time, and how many there are changes no byte.
/// @throws InvalidInput if the weights are none of its, or a chunk is longer than theirs.
std::unique_ptr<Policy> MakeLearnedPolicy(const std::filesystem::path& weights, int chunk_size);

/// Pictures as a world model's codec gives them back.
/// @param weights  of the codec, alone or in a checkpoint
/// @param config   the network's page
/// @throws InvalidInput or TensorError if the two are not of one codec, or either is broken.
ClipRoundTrip CodecRoundTrip(const std::filesystem::path& weights, const std::filesystem::path& config);

/// A subcommand as `evac -h` lists it; declared in commands.h, defined with the networks.
struct NetworkCommand {
  const char* name;
  const char* what;
};

inline constexpr NetworkCommand kFidelityCommand{
    "fidelity", "Say how true a world model is: outcomes and pictures against reality"};
inline constexpr NetworkCommand kWeightsCommand{"weights", "Look at, convert and make weights of the EVAC network."};
inline constexpr NetworkCommand kImagineCommand{"imagine",
                                                "Imagine what a camera sees when the arms do what was recorded"};
inline constexpr NetworkCommand kTrainCommand{"train",
                                              "Train the codec, the world model, the classifier judge, a policy."};
inline constexpr NetworkCommand kEncodeCommand{"encode",
                                               "Write the latents of shards beside them, as training reads them"};
inline constexpr NetworkCommand kVaryCommand{"vary",
                                             "Do what was recorded again, a little otherwise, and keep what came of it."};
inline constexpr NetworkCommand kPackCommand{"pack",
                                             "Turns recordings into the shards that networks are trained from."};
inline constexpr NetworkCommand kJudgeTrainCommand{
    "train", "Train a classifier for your own tasks, from clips that somebody has judged."};

}  // namespace evac
