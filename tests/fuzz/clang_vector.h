// Included before all else where Clang compiles LibTorch's headers. A std::vector of C++20 is constexpr, and Clang
// wants the whole element type of a constexpr member as soon as a header names it; LibTorch defines c10::IValue later.
// Here the vector of GCC's library is not constexpr.
#pragma once

#if __has_include(<bits/stl_algobase.h>)
#define _Bit_iterator _Bit_iterator_elsewhere  // a constexpr declaration of what <vector> then defines
#include <bits/stl_algobase.h>
#undef _Bit_iterator

#include <memory>
#include <string>
#undef _GLIBCXX20_CONSTEXPR
#define _GLIBCXX20_CONSTEXPR
#include <vector>
#undef _GLIBCXX20_CONSTEXPR
#define _GLIBCXX20_CONSTEXPR constexpr
#endif
