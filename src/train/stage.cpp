#include "doppel/train/stage.h"

#include "doppel/core/error.h"

namespace doppel {

void Stage::share_batches(Ranks& ranks) {
  fail<UsageError>("the stage {} cannot be trained by several ranks; found {}", name(), ranks.world());
}

}  // namespace doppel
