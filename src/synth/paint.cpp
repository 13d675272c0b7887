#include "doppel/synth/paint.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

namespace doppel::synth {

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMargin = 3;  ///< texels painted beyond the edge of a triangle

Vector3d mix(const Vector3d& a, const Vector3d& b, double t) { return a + std::clamp(t, 0.0, 1.0) * (b - a); }

/// 1 inside an ellipse around (0,0), 0 outside, soft at the rim.
double spot(double x, double y, double rx, double ry, double softness = 0.15) {
  return 1 - smooth_step(1 - softness, 1 + softness, std::hypot(x / rx, y / ry));
}

/// A soft square wave 0..1 of the given period, 1 for `share` of it.
double stripe(double x, double period, double share, double edge) {
  const double phase = x / period - std::floor(x / period);
  const double from_middle = std::abs(phase - 0.5) * period;
  return 1 - smooth_step(0.5 * share * period - edge, 0.5 * share * period + edge, from_middle);
}

Vector3d face_colour(const Vector3d& p, Vector3d c) {
  const double x = std::abs(p.x());
  c = mix(c, {0.88, 0.48, 0.42}, 0.35 * spot(x - 0.042, p.y() - 1.607, 0.022, 0.018, 0.7));  // cheeks
  c = mix(c, {0.95, 0.94, 0.92}, spot(x - 0.031, p.y() - 1.642, 0.0155, 0.0085));            // white of the eye
  c = mix(c, {0.20, 0.33, 0.48}, spot(x - 0.030, p.y() - 1.642, 0.0075, 0.0082));            // iris
  c = mix(c, {0.04, 0.04, 0.05}, spot(x - 0.030, p.y() - 1.642, 0.0038, 0.0042));            // pupil
  c = mix(c, {0.16, 0.09, 0.06}, spot(x - 0.031, p.y() - 1.652 + 5 * (x - 0.031) * (x - 0.031), 0.018, 0.0026));
  c = mix(c, {0.22, 0.13, 0.08},
          spot(x - 0.033, p.y() - 1.668 + 7 * (x - 0.033) * (x - 0.033), 0.021, 0.0048));         // brows
  c = mix(c, {0.72, 0.27, 0.27}, spot(x, p.y() - 1.576 - 2.5 * x * x, 0.026, 0.0075));            // lips
  c = mix(c, {0.42, 0.12, 0.13}, spot(x, p.y() - 1.5765 - 3 * x * x, 0.023, 0.0014));             // mouth
  return mix(c, {0.55, 0.33, 0.26}, 0.6 * spot(x - 0.0065, p.y() - 1.6025, 0.0042, 0.003, 0.5));  // nostrils
}

Vector3d skin_colour(const Vector3d& p) {
  const Vector3d skin(0.86, 0.64, 0.52);
  return p.y() > 1.5 && p.z() > 0.03 ? face_colour(p, skin) : skin;
}

Vector3d hair_colour(const Vector3d& p) {
  const double strand = 0.5 + 0.5 * std::sin(170 * std::atan2(p.x(), p.y() - 1.6) * 0.35 + 40 * p.z());
  return mix({0.20, 0.105, 0.055}, {0.33, 0.185, 0.10}, strand);
}

/// A pullover: rings around the sleeves, rings around the trunk, a yoke at the collar.
Vector3d shirt_colour(const BodyField& field, const Vector3d& p) {
  const Part part = field.part(p);
  const Vector3d q = p.x() < 0 ? mirrored(p) : p;
  const bool sleeve = part != kTorso && part != kSkirt;
  const double on_arm = (q - BodyPlan::shoulder()).dot(BodyPlan::arm_direction());
  const Vector3d blue(0.16, 0.30, 0.55), cream(0.93, 0.89, 0.80), yoke(0.95, 0.72, 0.22);
  // The sleeve's rings fade in beyond the shoulder seam, where they would not line up with those of the trunk.
  const double rings =
      sleeve ? stripe(on_arm, 0.052, 0.5, 0.003) * smooth_step(0.035, 0.045, on_arm) : stripe(p.y(), 0.052, 0.5, 0.003);
  Vector3d c = mix(blue, cream, rings);
  if (!sleeve) c = mix(c, yoke, smooth_step(1.355, 1.36, p.y()));
  if (sleeve) c = mix(yoke, c, smooth_step(0.035, 0.04, on_arm));
  if (sleeve) c = mix(c, yoke, smooth_step(0.475, 0.48, on_arm));  // cuff
  return c;
}

/// A bell of checked cloth with a border of dots and a belt.
Vector3d skirt_colour(const Vector3d& p) {
  const double angle = std::atan2(p.x(), p.z()), turn = angle / (2 * M_PI) * 18;
  const Vector3d crimson(0.66, 0.12, 0.18), dark(0.36, 0.06, 0.14), gold(0.96, 0.78, 0.36);
  const double across = stripe(turn, 1.0, 0.5, 0.02), level = stripe(p.y(), 0.075, 0.5, 0.003);
  Vector3d c = mix(crimson, dark, 0.5 * (across + level));
  c = mix(c, gold, 0.85 * stripe(turn + 0.25, 1.0, 0.06, 0.012));
  c = mix(c, gold, 0.85 * stripe(p.y() + 0.018, 0.075, 0.06, 0.002));
  c = mix(c, Vector3d(0.94, 0.90, 0.82), 1 - smooth_step(BodyPlan::kHem + 0.05, BodyPlan::kHem + 0.053, p.y()));
  const double slot = turn * 2 - std::floor(turn * 2) - 0.5;
  c = mix(c, crimson, spot(slot * 0.055, p.y() - BodyPlan::kHem - 0.03, 0.012, 0.011));
  const double belt = smooth_step(BodyPlan::kWaist - 0.033, BodyPlan::kWaist - 0.03, p.y());
  c = mix(c, {0.17, 0.11, 0.08}, belt);
  const double buckle = p.z() > 0 ? 1.0 : 0.0;
  return mix(c, gold, buckle * belt * spot(p.x(), p.y() - BodyPlan::kWaist + 0.012, 0.024, 0.018, 0.08));
}

Vector3d trousers_colour(const Vector3d& p) {
  const double weave = 0.5 + 0.5 * std::sin(420 * (p.y() + 0.4 * p.x()));
  return mix({0.13, 0.15, 0.23}, {0.19, 0.22, 0.32}, weave);
}

Vector3d shoe_colour(const Vector3d& p) {
  const Vector3d leather(0.44, 0.24, 0.12), sole(0.92, 0.90, 0.86);
  Vector3d c = mix(sole, leather, smooth_step(0.016, 0.019, p.y()));
  if (p.z() > 0.02 && p.y() > 0.05) c = mix(c, sole, 0.9 * stripe(p.z(), 0.024, 0.35, 0.002));
  return c;
}

/// Paints one triangle: its texels (`inside`), or the margin around it where no other triangle has painted.
class TrianglePainter {
 public:
  TrianglePainter(const TriangleMesh& mesh, const BodyField& field, cv::Mat& texture, cv::Mat& distance)
      : mesh_(mesh), field_(field), texture_(texture), distance_(distance) {}

  void paint(int face) {
    const int size = texture_.rows;
    Vector2d t[3];
    for (int c = 0; c < 3; ++c) {
      const Vector2d& uv = mesh_.uvs[mesh_.face_uvs[face][c]];
      t[c] = {uv.x() * size, (1 - uv.y()) * size};
    }
    Matrix2d edges;
    edges << t[1] - t[0], t[2] - t[0];
    const Matrix2d inverse = edges.inverse();
    const Vector2d low = t[0].cwiseMin(t[1]).cwiseMin(t[2]), high = t[0].cwiseMax(t[1]).cwiseMax(t[2]);
    for (int y = std::max(0, static_cast<int>(low.y()) - kMargin); y < std::min<double>(size, high.y() + kMargin); ++y)
      for (int x = std::max(0, static_cast<int>(low.x()) - kMargin); x < std::min<double>(size, high.x() + kMargin);
           ++x)
        paint_texel(face, x, y, inverse * (Vector2d(x + 0.5, y + 0.5) - t[0]), t);
  }

 private:
  void paint_texel(int face, int x, int y, const Vector2d& b, const Vector2d* t) {
    const float away = static_cast<float>(distance_outside({x + 0.5, y + 0.5}, b, t));
    if (away > kMargin || away >= distance_.at<float>(y, x)) return;
    distance_.at<float>(y, x) = away;
    const Triangle& f = mesh_.faces[face];
    const Vector3d& origin = mesh_.vertices[f[0]];
    const Vector3d p = origin + b.x() * (mesh_.vertices[f[1]] - origin) + b.y() * (mesh_.vertices[f[2]] - origin);
    const Vector3d c = 255 * colour_at(field_, p);
    texture_.at<cv::Vec3b>(y, x) = {cv::saturate_cast<uchar>(c.z()), cv::saturate_cast<uchar>(c.y()),
                                    cv::saturate_cast<uchar>(c.x())};
  }

  /// Distance of a texel from the triangle, in texels; 0 inside.
  static double distance_outside(const Vector2d& p, const Vector2d& b, const Vector2d* t) {
    if (b.x() >= 0 && b.y() >= 0 && b.x() + b.y() <= 1) return 0;
    double nearest = std::numeric_limits<double>::infinity();
    for (int c = 0; c < 3; ++c) {
      const Vector2d edge = t[(c + 1) % 3] - t[c];
      const double s = std::clamp((p - t[c]).dot(edge) / std::max(edge.squaredNorm(), 1e-12), 0.0, 1.0);
      nearest = std::min(nearest, (p - t[c] - s * edge).norm());
    }
    return nearest;
  }

  const TriangleMesh& mesh_;
  const BodyField& field_;
  cv::Mat& texture_;
  cv::Mat& distance_;
};

}  // namespace

Material material_at(const BodyField& field, const Vector3d& p) {
  const Part part = field.part(p);
  const Vector3d q = p.x() < 0 ? mirrored(p) : p;
  switch (part) {
    case kHair:
      return Material::hair;
    case kHead:
      return p.y() < 1.475 - 0.25 * p.z() ? Material::shirt : Material::skin;
    case kTorso:
      return p.y() < BodyPlan::kWaist - 0.03 ? Material::skirt : Material::shirt;
    case kSkirt:
      return Material::skirt;
    case kLeftHand:
    case kRightHand:
      return Material::skin;
    case kLeftForearm:
    case kRightForearm:
      return (q - BodyPlan::shoulder()).dot(BodyPlan::arm_direction()) > 0.495 ? Material::skin : Material::shirt;
    case kLeftFoot:
    case kRightFoot:
      return p.y() > 0.115 ? Material::trousers : Material::shoe;
    case kLeftArm:
    case kRightArm:
      return Material::shirt;
    default:
      return p.y() < 0.1 ? Material::shoe : Material::trousers;
  }
}

Vector3d colour_at(const BodyField& field, const Vector3d& p) {
  switch (material_at(field, p)) {
    case Material::skin:
      return skin_colour(p);
    case Material::hair:
      return hair_colour(p);
    case Material::shirt:
      return shirt_colour(field, p);
    case Material::skirt:
      return skirt_colour(p);
    case Material::trousers:
      return trousers_colour(p);
    case Material::shoe:
      break;
  }
  return shoe_colour(p);
}

cv::Mat paint_texture(const TriangleMesh& mesh, const BodyField& field, int size) {
  cv::Mat texture(size, size, CV_8UC3, cv::Scalar(110, 110, 110));
  cv::Mat distance(size, size, CV_32F, cv::Scalar(std::numeric_limits<float>::infinity()));
  TrianglePainter painter(mesh, field, texture, distance);
  for (int f = 0; f < mesh.num_faces(); ++f) painter.paint(f);
  return texture;
}

std::vector<int> parser_labels(const TriangleMesh& mesh, const BodyField& field) {
  std::vector<int> labels;
  for (const Vector3d& p : mesh.vertices) {
    const bool left = p.x() > 0;
    const Part part = field.part(p);
    switch (material_at(field, p)) {
      case Material::hair:
        labels.push_back(2);
        break;
      case Material::skin:
        labels.push_back(part == kHead ? 13 : left ? 14 : 15);
        break;
      case Material::shirt:
        labels.push_back(5);
        break;
      case Material::skirt:
        labels.push_back(12);
        break;
      case Material::trousers:
        labels.push_back(9);
        break;
      case Material::shoe:
        labels.push_back(left ? 18 : 19);
        break;
    }
  }
  return labels;
}

}  // namespace doppel::synth
