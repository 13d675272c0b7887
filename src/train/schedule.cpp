#include "doppel/train/schedule.h"

#include <algorithm>
#include <cmath>

namespace doppel {

namespace {

/// Half a cosine from 1 down to `final_ratio`.
double falling(double final_ratio, double done, double length) {
  return final_ratio + (1.0 - final_ratio) * 0.5 * (1.0 + std::cos(M_PI * std::min(1.0, done / length)));
}

}  // namespace

void describe_keys(const Keys& keys, Schedule& schedule) {
  keys("learning_rate", schedule.learning_rate, between(0.0, 10.0), "after the warm-up");
  keys("schedule", schedule.kind, {"constant", "cosine"}, "of the learning rate");
  keys("warmup", schedule.warmup, at_least<std::int64_t>(0), "steps of linear growth at the start");
  keys("final_ratio", schedule.final_ratio, between(0.0, 1.0), "cosine: last rate / first rate");
}

double Schedule::rate(std::int64_t step) const {
  if (kind == Kind::pieces) {
    std::int64_t begin = 0;
    for (const Piece& piece : pieces) {
      if (step < piece.end)
        return piece.rate *
               falling(piece.final_ratio, static_cast<double>(step - begin), static_cast<double>(piece.end - begin));
      begin = piece.end;
    }
    return pieces.empty() ? 0.0 : pieces.back().rate * pieces.back().final_ratio;
  }
  if (step < warmup) return learning_rate * static_cast<double>(step + 1) / static_cast<double>(warmup);
  if (kind == Kind::constant) return learning_rate;
  return learning_rate * falling(final_ratio, static_cast<double>(step - warmup),
                                 static_cast<double>(std::max<std::int64_t>(1, iterations - warmup)));
}

}  // namespace doppel
