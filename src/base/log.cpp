#include <pliant/base/log.h>
#include <pliant/base/petsc.h>

#include <array>

namespace pliant {
namespace {

constexpr std::array event_names{"PliantForces",   "PliantLists",  "PliantGhosts", "PliantHalo",      "PliantSort",
                                 "PliantReinsert", "PliantSample", "PliantFrame",  "PliantCheckpoint"};
constexpr std::array stage_names{"Packing", "Run"};

/// PETSc's numbers, registered at the first use.
struct Registered {
  std::array<PetscLogEvent, event_names.size()> event;
  std::array<PetscLogStage, stage_names.size()> stage;

  Registered() {
    PetscClassId id = 0;
    petsc_check(PetscClassIdRegister("Pliant", &id));
    for (std::size_t k = 0; k < event.size(); ++k) petsc_check(PetscLogEventRegister(event_names[k], id, &event[k]));
    for (std::size_t k = 0; k < stage.size(); ++k) petsc_check(PetscLogStageRegister(stage_names[k], &stage[k]));
  }
};

thread_local bool logging = false;  // PETSc's log is for one thread

const Registered& registered() {
  static const Registered once;
  return once;
}

}  // namespace

void start_log() {
  PetscBool asked = PETSC_FALSE;
  petsc_check(PetscOptionsHasName(nullptr, nullptr, "-log_view", &asked));
  if (asked == PETSC_FALSE) return;
  petsc_check(PetscLogDefaultBegin());
  registered();
  logging = true;
}

LogScope::LogScope(LogEvent event) {
  if (!logging) return;
  event_ = registered().event[static_cast<std::size_t>(event)];
  (void)PetscLogEventBegin(event_, 0, 0, 0, 0);
}

LogScope::LogScope(LogStage stage) {
  if (!logging) return;
  stage_ = true;
  (void)PetscLogStagePush(registered().stage[static_cast<std::size_t>(stage)]);
}

LogScope::~LogScope() {
  if (event_ >= 0) (void)PetscLogEventEnd(event_, 0, 0, 0, 0);
  if (stage_) (void)PetscLogStagePop();
}

}  // namespace pliant
