#include "doppel/io/scene/meshopt_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "support/packed_gltf.h"

namespace doppel::meshopt_view_test {
namespace {

using support::PackedBytes;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string_view text_of(const PackedBytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

template <typename T>
std::vector<T> numbers_of(const UnpackedView& view) {
  EXPECT_THAT(view.fault, IsEmpty());
  std::vector<T> numbers(view.bytes.size() / sizeof(T));
  std::memcpy(numbers.data(), view.bytes.data(), sizeof(T) * numbers.size());
  return numbers;
}

/// Unit vectors with 4 values each; the fourth is 1 where `count_of_values` is 3.
std::vector<float> unit_vectors(std::size_t count, std::size_t count_of_values) {
  std::vector<float> values;
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = static_cast<float>(i);
    Eigen::Vector4f vector(std::sin(at), std::cos(2 * at), std::sin(3 * at + 1), std::cos(5 * at));
    if (count_of_values == 3) vector[3] = 0;
    vector.normalize();
    if (count_of_values == 3) vector[3] = 1;
    values.insert(values.end(), vector.data(), vector.data() + 4);
  }
  return values;
}

TEST(MeshoptView, AttributesKeepTheirBits) {
  for (const std::size_t stride : {std::size_t{4}, std::size_t{12}, std::size_t{64}, std::size_t{256}}) {
    std::vector<unsigned char> data(stride * 301);
    for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<unsigned char>(i * i / 7);
    const PackedBytes stream = support::packed_attributes(data.data(), 301, stride);
    EXPECT_EQ(numbers_of<unsigned char>(unpack_meshopt({text_of(stream), 301, stride, "ATTRIBUTES"})), data);
  }
}

TEST(MeshoptView, IndicesKeepTheirOrder) {
  const std::vector<std::uint32_t> corners{0, 1, 2, 2, 1, 3, 3, 1, 4, 70, 3, 2};
  const auto triangles = support::packed_triangles(corners, 71), sequence = support::packed_sequence(corners, 71);
  const auto found = numbers_of<std::uint32_t>(unpack_meshopt({text_of(triangles), 12, 4, "TRIANGLES"}));
  ASSERT_EQ(found.size(), corners.size());
  for (std::size_t t = 0; t < corners.size(); t += 3) {  // the encoder may turn a triangle, not over
    std::vector<std::uint32_t> turned(found.begin() + static_cast<long>(t), found.begin() + static_cast<long>(t) + 3);
    while (turned[0] != corners[t]) std::rotate(turned.begin(), turned.begin() + 1, turned.end());
    EXPECT_THAT(turned, ::testing::ElementsAre(corners[t], corners[t + 1], corners[t + 2]));
  }
  EXPECT_THAT(numbers_of<std::uint16_t>(unpack_meshopt({text_of(sequence), 12, 2, "INDICES"})),
              ::testing::ElementsAreArray(corners));
}

TEST(MeshoptView, OctahedralVectorsAreWithinTheirBits) {
  constexpr std::size_t kCount = 37;  // not a multiple of four, as the filter's blocks are
  const std::vector<float> vectors = unit_vectors(kCount, 3);
  PackedBytes bytes(8 * kCount);
  meshopt_encodeFilterOct(bytes.data(), kCount, 4, 8, vectors.data());
  const auto small = numbers_of<std::int8_t>(unpack_meshopt(
      {text_of(support::packed_attributes(bytes.data(), kCount, 4)), kCount, 4, "ATTRIBUTES", "OCTAHEDRAL"}));
  meshopt_encodeFilterOct(bytes.data(), kCount, 8, 12, vectors.data());
  const auto large = numbers_of<std::int16_t>(unpack_meshopt(
      {text_of(support::packed_attributes(bytes.data(), kCount, 8)), kCount, 8, "ATTRIBUTES", "OCTAHEDRAL"}));
  for (std::size_t i = 0; i < 4 * kCount; ++i) {
    if (i % 4 == 3) continue;
    EXPECT_NEAR(small[i] / 127.0, vectors[i], 2.0 / 127);
    EXPECT_NEAR(large[i] / 32767.0, vectors[i], 2.0 / 2047);
  }
}

TEST(MeshoptView, QuaternionsAreWithinTheirBits) {
  constexpr std::size_t kCount = 45;
  const std::vector<float> turns = unit_vectors(kCount, 4);
  PackedBytes bytes(8 * kCount);
  meshopt_encodeFilterQuat(bytes.data(), kCount, 8, 12, turns.data());
  const auto found = numbers_of<std::int16_t>(unpack_meshopt(
      {text_of(support::packed_attributes(bytes.data(), kCount, 8)), kCount, 8, "ATTRIBUTES", "QUATERNION"}));
  for (std::size_t i = 0; i < kCount; ++i) {
    Eigen::Vector4d turn;
    for (Eigen::Index c = 0; c < 4; ++c) turn[c] = found[4 * i + static_cast<std::size_t>(c)] / 32767.0;
    const Eigen::Vector4d wanted = Eigen::Map<const Eigen::Vector4f>(&turns[4 * i]).cast<double>();
    EXPECT_GT(std::abs(turn.normalized().dot(wanted)), 1 - 2.0 / (2047.0 * 2047.0));
  }
}

TEST(MeshoptView, FloatsOfTheExponentialFilterAreWithinTheirBits) {
  const std::vector<float> values{0, 1, -1, 1000.5F, 3e-5F, -7.25F, 0.1F, 12345, -0.3F};
  PackedBytes bytes(4 * values.size());
  meshopt_encodeFilterExp(bytes.data(), values.size(), 4, 15, values.data());
  const auto found =
      numbers_of<float>(unpack_meshopt({text_of(support::packed_attributes(bytes.data(), values.size(), 4)),
                                        values.size(), 4, "ATTRIBUTES", "EXPONENTIAL"}));
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_NEAR(found[i], values[i], std::abs(values[i]) / (1 << 13)) << values[i];
}

TEST(MeshoptView, NoElementsAreNoBytes) {
  const UnpackedView view = unpack_meshopt({"", 0, 4, "ATTRIBUTES"});
  EXPECT_THAT(view.fault, IsEmpty());
  EXPECT_THAT(view.bytes, IsEmpty());
}

TEST(MeshoptViewRejects, WhatTheStreamCannotBe) {
  const std::vector<float> values(300, 0.5F);
  const PackedBytes stream = support::packed_attributes(values.data(), 300, 4);
  const std::string_view whole = text_of(stream);
  const auto fault = [](const MeshoptView& view) { return unpack_meshopt(view).fault; };
  EXPECT_THAT(fault({whole.substr(0, whole.size() - 1), 300, 4, "ATTRIBUTES"}), HasSubstr("truncated or damaged"));
  EXPECT_THAT(fault({whole, 299, 4, "INDICES"}), HasSubstr("cannot decode"));
  EXPECT_THAT(fault({whole, 300, 4, "COLOURS"}), HasSubstr("allowed are ATTRIBUTES, TRIANGLES and INDICES"));
  EXPECT_THAT(fault({whole, 300, 6, "ATTRIBUTES"}), HasSubstr("multiples of 4 up to 256"));
  EXPECT_THAT(fault({whole, 300, 260, "ATTRIBUTES"}), HasSubstr("multiples of 4 up to 256"));
  EXPECT_THAT(fault({whole, 300, 12, "TRIANGLES"}), HasSubstr("2 or 4"));
  EXPECT_THAT(fault({whole, 301, 4, "TRIANGLES"}), HasSubstr("not three each"));
  EXPECT_THAT(fault({whole, 1'000'000'000, 256, "ATTRIBUTES"}), HasSubstr("compressed ones can hold"));
  EXPECT_THAT(fault({whole, 300, 4, "ATTRIBUTES", "NONE", 1199}), HasSubstr("more than is read"));
  EXPECT_THAT(fault({whole, 300, 4, "ATTRIBUTES", "COLOR"}), HasSubstr("filter 'COLOR'"));
  EXPECT_THAT(fault({whole, 300, 4, "TRIANGLES", "EXPONENTIAL"}), HasSubstr("a filter in the mode TRIANGLES"));
  EXPECT_THAT(fault({whole, 300, 4, "ATTRIBUTES", "QUATERNION"}), HasSubstr("which the filter QUATERNION does not"));
  PackedBytes newer = stream;
  newer[0] = 0xA1;
  EXPECT_THAT(fault({text_of(newer), 300, 4, "ATTRIBUTES"}), HasSubstr("version 1 of meshopt's codec"));
}

}  // namespace
}  // namespace doppel::meshopt_view_test
