#pragma once

#include "core/recording.h"
#include "core/world.h"
#include "harness/suite.h"

namespace evac {

/// Suites that begin from recordings: of one, or of a folder of several, each an initial state of one task.

/// What begins in an initial state, as all the suite's worlds take it: as their networks were trained to see it (one in
/// so many steps, some of its cameras), and whole where no world is a network.
/// @throws InvalidInput as ReadRecording and ReadAsTrained; as DemandRecordingUnchanged if it is another than when the
///   suite was read; of a state that FillInRecordedTask did not fill in
Recording RecordingOf(const Suite& suite, const InitialState& initial);

/// Fills in task, initial states and `recordings` of a suite that begins from recordings; others are left as they are.
/// Of one: the task is called like it, the state "recording". Of a folder of several: the task is called like the
/// tree's or collection's task, or like the folder; each state like its recording, or of a collection like the state
/// that it began from (of several the first). Where the suite says what the task is called, it is called so. The task's cameras and arms are the first recording's, its workspace and
/// its chunks those of all. Those that cannot be read, or not by the same cameras and arms, are left out, and said: also
/// by cameras that are calibrated otherwise than the first's (CalibrationDifference; the principal point by kSameFocal
/// of a side), which policies are told of in every state.
/// @throws InvalidInput if none is left, if they are of several tasks, if fewer are left than the suite asks for, or if
/// one is another than when the suite was read; for what is wrong with the suite itself (kSuiteError).
void FillInRecordedTask(Suite& suite);

}  // namespace evac
