#include "doppel/train/schedule.h"

#include <algorithm>
#include <cmath>

namespace doppel {

Schedule Schedule::read(const ConfigReader& reader, std::int64_t iterations) {
  Schedule s;
  s.iterations = iterations;
  s.learning_rate = reader.get("learning_rate", s.learning_rate, between(0.0, 10.0));
  const std::string kind = reader.choice("schedule", {"constant", "cosine", "step", "exponential"}, "constant");
  s.kind = kind == "cosine"        ? Kind::cosine
           : kind == "step"        ? Kind::step
           : kind == "exponential" ? Kind::exponential
                                   : Kind::constant;
  s.warmup = reader.get<long>("warmup", s.warmup, at_least(0L));
  s.final_ratio = reader.get("final_ratio", s.final_ratio, between(0.0, 1.0));
  s.factor = reader.get("decay_factor", s.factor, between(0.0, 1.0));
  s.interval = reader.get<long>("decay_interval", s.interval, at_least(1L));
  return s;
}

double Schedule::rate(std::int64_t step) const {
  if (kind == Kind::pieces) {
    for (const Piece& piece : pieces)
      if (step < piece.end) return piece.rate;
    return pieces.empty() ? 0.0 : pieces.back().rate;
  }
  if (step < warmup) return learning_rate * static_cast<double>(step + 1) / static_cast<double>(warmup);
  const double done = static_cast<double>(step - warmup);
  switch (kind) {
    case Kind::constant:
      return learning_rate;
    case Kind::cosine: {
      const double length = static_cast<double>(std::max<std::int64_t>(1, iterations - warmup));
      const double falling = 0.5 * (1.0 + std::cos(M_PI * std::min(1.0, done / length)));
      return learning_rate * (final_ratio + (1.0 - final_ratio) * falling);
    }
    case Kind::step:
      return learning_rate * std::pow(factor, std::floor(done / static_cast<double>(interval)));
    case Kind::exponential:
      return learning_rate * std::pow(factor, done / static_cast<double>(interval));
    case Kind::pieces:
      break;  // above: they need no warm-up
  }
  return learning_rate;
}

}  // namespace doppel
