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
  const double done = static_cast<double>(step - warmup);
  switch (kind) {
    case Kind::constant:
      return learning_rate;
    case Kind::cosine:
      return learning_rate *
             falling(final_ratio, done, static_cast<double>(std::max<std::int64_t>(1, iterations - warmup)));
    case Kind::step:
      return learning_rate * std::pow(factor, std::floor(done / static_cast<double>(interval)));
    case Kind::exponential:
      return learning_rate * std::pow(factor, done / static_cast<double>(interval));
    case Kind::pieces:
      break;  // handled above, without warm-up
  }
  return learning_rate;
}

}  // namespace doppel
