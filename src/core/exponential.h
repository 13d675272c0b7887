#pragma once

/// For kernel files only (see cpu_dispatch.h): e^x for vectors of floats.

namespace doppel::kernels::DOPPEL_ISA {

/// e^x for x <= 0 to about 1e-7, that of -87 below: 2^n times a polynomial on [-ln2/2, ln2/2] (Cephes expf).
/// @tparam Floats, Ints vectors of as many 32-bit lanes
template <typename Floats, typename Ints>
static inline Floats exp_of_negative(Floats x) {
  const Floats lowest = Floats{} - 87.0f, to_nearest = Floats{} + 12582912.0f;  // 1.5 * 2^23: adding it rounds
  const Ints below = x < lowest;
  x = (Floats)((below & (Ints)lowest) | (~below & (Ints)x));
  const Floats n = (x * 1.44269504f + to_nearest) - to_nearest;
  const Floats r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
  Floats e = r * 1.9875691500e-4f + 1.3981999507e-3f;
  e = e * r + 8.3334519073e-3f;
  e = e * r + 4.1665795894e-2f;
  e = e * r + 1.6666665459e-1f;
  e = e * r + 5.0000001201e-1f;
  e = e * (r * r) + r + 1.0f;
  const Ints exponent = (__builtin_convertvector(n, Ints) + 127) << 23;
  return e * (Floats)exponent;
}

}  // namespace doppel::kernels::DOPPEL_ISA
