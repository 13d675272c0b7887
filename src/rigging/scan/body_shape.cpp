#include "doppel/rigging/scan/body_shape.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <unordered_map>

#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/rigging/scan/edge_table.h"
#include "doppel/rigging/scan/floor.h"
#include "doppel/rigging/scan/voxel_parts.h"

namespace doppel {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

constexpr double kQuantile = 0.01, kBeyondQuantile = 0.4;  // of the face centres; specks far away lie beyond
constexpr double kClustersAlong = 150.0;                   // cells of the coarse mesh along the longest side
constexpr double kCellsAlong = 80.0;                       // cells of the coarse solid
constexpr double kPartsAlong = 64.0;  // cells of the grid that tells parts apart; parts a cell apart are one
constexpr double kSpeckSize = 0.06;   // of the largest extent
constexpr int kSlices = 100;
constexpr double kFootTop = 0.035, kAnkleBottom = 0.05, kAnkleTop = 0.1;  // shares of the height
constexpr double kOverlapNoise = 0.01;   // of the overlap between neighbouring directions
constexpr std::size_t kMirrored = 5000;  // cells that are mirrored
constexpr double kMinToeLength = 0.008;
constexpr double kSearchTurn = 30.0;     // degrees on either side of the toes' direction
constexpr double kTurnPenalty = 1.5e-4;  // overlap per squared degree

AlignedBox3d likely_box(const TriangleMesh& mesh) {
  std::array<std::vector<double>, 3> positions;
  for (const Triangle& face : mesh.faces) {
    const Vector3d middle = (mesh.vertices[face[0]] + mesh.vertices[face[1]] + mesh.vertices[face[2]]) / 3.0;
    if (!middle.allFinite()) continue;
    for (int k = 0; k < 3; ++k) positions[k].push_back(middle[k]);
  }
  if (positions[0].empty())
    fail<UsageError>("finding the orientation of the scan: no triangle has finite corners; check the file");
  Vector3d low, high;
  for (int k = 0; k < 3; ++k) {
    low[k] = quantile(positions[k], kQuantile);
    high[k] = quantile(std::move(positions[k]), 1.0 - kQuantile);
  }
  const double beyond = kBeyondQuantile * (high - low).maxCoeff();
  return {low - Vector3d::Constant(beyond), high + Vector3d::Constant(beyond)};
}

AlignedBox3d box_of(const TriangleMesh& mesh) {
  AlignedBox3d box;
  for (const Triangle& face : mesh.faces)
    for (const int v : face) box.extend(mesh.vertices[v]);
  return box;
}

/// The cells of the part with the largest surface, and its share among all parts.
class MainPart {
 public:
  explicit MainPart(const TriangleMesh& mesh) {
    const AlignedBox3d box = box_of(mesh);
    cell_ = std::max(box.sizes().maxCoeff() / kPartsAlong, 1e-300);
    origin_ = box.min() - Vector3d::Constant(2.5 * cell_);  // the border stays empty in spite of rounding
    for (int k = 0; k < 3; ++k) layout_.dims[k] = static_cast<int>(box.sizes()[k] / cell_) + 6;
    const std::vector<std::uint8_t> crossed = crossed_cells(layout_, origin_, cell_, mesh);
    std::vector<std::uint8_t> empty = dilated(layout_, crossed, 1);
    for (std::uint8_t& cell : empty) cell = cell == 0;
    // Where the walls are what is empty, the spaces between them are the parts.
    for (const std::vector<int>& part : enclosed_spaces(layout_, empty)) {
      int size = 0;
      for (const int cell : part) size += crossed[cell];
      total_ += size;
      if (size <= largest_) continue;
      largest_ = size;
      inside_.assign(layout_.size(), false);
      for (const int cell : part) inside_[cell] = true;
    }
  }

  bool holds(const Vector3d& point) const {
    if (inside_.empty()) return true;
    const Eigen::Array3d position = ((point - origin_) / cell_).array().floor();
    for (int k = 0; k < 3; ++k)
      if (!(position[k] >= 0.0 && position[k] < layout_.dims[k])) return false;
    return inside_[layout_.index(static_cast<int>(position[0]), static_cast<int>(position[1]),
                                 static_cast<int>(position[2]))];
  }
  double share() const { return total_ > 0 ? static_cast<double>(largest_) / total_ : 1.0; }

 private:
  VoxelLayout layout_{};
  Vector3d origin_;
  double cell_ = 1.0;
  std::vector<bool> inside_;
  int largest_ = 0, total_ = 0;
};

TriangleMesh only_main_part(const TriangleMesh& mesh, const MainPart& part) {
  TriangleMesh out;
  out.vertices = mesh.vertices;
  for (const Triangle& face : mesh.faces)
    if (part.holds(mesh.vertices[face[0]])) out.faces.push_back(face);
  return out.faces.empty() ? mesh : out;
}

struct FoundFloor {
  int direction = -1;
  double level = 0.0;  ///< along the direction; the body lies above
};

/// The floor with the largest area in any of the six directions.
FoundFloor search_floor(const TriangleMesh& mesh) {
  const AlignedBox3d box = box_of(mesh);
  FoundFloor found;
  double area = 0.0;
  for (int d = 0; d < 6; ++d) {
    const Vector3d up = axis_direction(d);
    const double a = box.min().dot(up), b = box.max().dot(up);
    const auto sheet = find_floor(mesh, up, std::min(a, b), std::max(a, b), box.sizes().maxCoeff());
    if (!sheet || sheet->area <= area) continue;
    area = sheet->area;
    found = {d, sheet->level + sheet->thickness};
  }
  return found;
}

TriangleMesh above_floor(const TriangleMesh& mesh, const FoundFloor& floor) {
  const Vector3d up = axis_direction(floor.direction);
  TriangleMesh out;
  out.vertices = mesh.vertices;
  for (const Triangle& face : mesh.faces) {
    bool above = false;
    for (const int v : face) above = above || mesh.vertices[v].dot(up) > floor.level;
    if (above) out.faces.push_back(face);
  }
  return out.faces.empty() ? mesh : out;
}

/// Drops small components. Hair and eyes may go too: nothing here depends on them.
TriangleMesh without_specks(const TriangleMesh& mesh) {
  int count = 0;
  const std::vector<int> component = face_components(mesh.faces, mesh.vertices.size(), count);
  std::vector<AlignedBox3d> boxes(count);
  for (std::size_t f = 0; f < component.size(); ++f)
    for (const int v : mesh.faces[f]) boxes[component[f]].extend(mesh.vertices[v]);
  const double least = kSpeckSize * box_of(mesh).sizes().maxCoeff();
  TriangleMesh out;
  out.vertices = mesh.vertices;
  for (std::size_t f = 0; f < component.size(); ++f)
    if (boxes[component[f]].diagonal().norm() > least) out.faces.push_back(mesh.faces[f]);
  return out.faces.empty() ? mesh : out;
}

/// The extent of the original vertices of the clusters in use, above the floor.
AlignedBox3d exact_box(const TriangleMesh& mesh, const TriangleMesh& coarse, const std::vector<int>& cluster,
                       const FoundFloor& floor) {
  std::vector<bool> used(coarse.vertices.size(), false);
  for (const Triangle& face : coarse.faces)
    for (const int v : face) used[v] = true;
  AlignedBox3d box;
  for (std::size_t v = 0; v < cluster.size(); ++v) {
    if (cluster[v] < 0 || !used[cluster[v]]) continue;
    if (floor.direction >= 0 && mesh.vertices[v].dot(axis_direction(floor.direction)) < floor.level) continue;
    box.extend(mesh.vertices[v]);
  }
  return box;
}

/// A horizontal area for each of the slices of the body, and whether the line through its centre is inside.
struct Profile {
  std::array<double, kSlices> area{};
  std::array<bool, kSlices> centre_inside{};
};

double height_share(const CoarseBody& body, const Vector3d& point, const Vector3d& up) {
  const double a = body.box.min().dot(up), b = body.box.max().dot(up);
  return (point.dot(up) - std::min(a, b)) / std::abs(b - a);
}

Vector3d centre_of(const std::vector<Vector3d>& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : points) sum += p;
  return sum / static_cast<double>(std::max<std::size_t>(1, points.size()));
}

Profile profile_along(const CoarseBody& body, const Vector3d& up) {
  Profile profile;
  const double a = body.box.min().dot(up), b = body.box.max().dot(up), low = std::min(a, b), extent = std::abs(b - a);
  const Vector3d centre = centre_of(body.cells), foot = centre - centre.dot(up) * up;
  for (int k = 0; k < kSlices; ++k) {
    const Vector3d point = foot + (low + (k + 0.5) / kSlices * extent) * up;
    profile.centre_inside[k] = body.solid.inside(point);
  }
  // A cell is thicker or thinner than a slice: it is shared out.
  const double half = 0.5 * body.solid.cell_size() / extent * kSlices;
  for (const Vector3d& cell : body.cells) {
    const double middle = (cell.dot(up) - low) / extent * kSlices;
    for (int k = std::max(0, static_cast<int>(middle - half)); k <= std::min(kSlices - 1.0, middle + half); ++k)
      profile.area[k] += std::max(0.0, std::min(middle + half, k + 1.0) - std::max(middle - half, k + 0.0));
  }
  return profile;
}

double mean_area(const Profile& profile, int first, int last, bool from_above) {
  double sum = 0.0;
  for (int k = first; k < last; ++k) sum += profile.area[from_above ? kSlices - 1 - k : k];
  return sum / (last - first);
}

int gap(const Profile& profile, bool from_above) {
  // A few slices may be inside: hair that ends in a curl, a skirt's hem.
  int last = 0, inside = 0;
  for (int k = 0; k < kSlices && inside < 3; ++k) {
    if (profile.centre_inside[from_above ? kSlices - 1 - k : k])
      ++inside;
    else
      last = k + 1 - inside;
  }
  return last;
}

/// The share of the body's cells whose mirror image lies in the body.
double mirror_overlap(const CoarseBody& body, const std::vector<Vector3d>& cells, const Vector3d& centre,
                      const Vector3d& across) {
  const std::size_t step = 1 + cells.size() / kMirrored;
  int hits = 0, tried = 0;
  for (std::size_t i = 0; i < cells.size(); i += step, ++tried)
    hits += body.solid.inside(cells[i] - 2.0 * (cells[i] - centre).dot(across) * across);
  return static_cast<double>(hits) / std::max(1, tried);
}

}  // namespace

Vector3d axis_direction(int direction) { return (direction % 2 == 0 ? 1.0 : -1.0) * Vector3d::Unit(direction / 2); }

TriangleMesh clustered(const TriangleMesh& mesh, double cell, const AlignedBox3d& box, std::vector<int>& cluster) {
  TriangleMesh out;
  std::vector<int> counts;
  cluster.assign(mesh.vertices.size(), -1);
  std::unordered_map<std::uint64_t, int> cells;
  const auto cluster_of = [&](int v) {
    if (cluster[v] >= 0) return cluster[v];
    const Vector3d& p = mesh.vertices[v];
    std::uint64_t key = 0;
    for (int k = 0; k < 3; ++k) key = key << 21 | static_cast<std::uint64_t>((p[k] - box.min()[k]) / cell);
    const auto [entry, fresh] = cells.emplace(key, out.num_vertices());
    if (fresh) {
      out.vertices.emplace_back(Vector3d::Zero());
      counts.push_back(0);
    }
    out.vertices[entry->second] += p;
    ++counts[entry->second];
    return cluster[v] = entry->second;
  };
  for (const Triangle& face : mesh.faces) {
    bool usable = true;
    for (const int v : face) usable = usable && mesh.vertices[v].allFinite() && box.contains(mesh.vertices[v]);
    if (!usable) continue;
    const Triangle merged{cluster_of(face[0]), cluster_of(face[1]), cluster_of(face[2])};
    if (merged[0] != merged[1] && merged[1] != merged[2] && merged[2] != merged[0]) out.faces.push_back(merged);
  }
  for (std::size_t v = 0; v < counts.size(); ++v) out.vertices[v] /= counts[v];
  return out;
}

CoarseBody coarse_body(const TriangleMesh& mesh) {
  const AlignedBox3d likely = likely_box(mesh);
  std::vector<int> cluster;
  TriangleMesh coarse = clustered(mesh, std::max(likely.sizes().maxCoeff() / kClustersAlong, 1e-300), likely, cluster);
  if (coarse.faces.empty())
    fail<UsageError>("finding the orientation of the scan: all triangles lie in one point; check the file");
  const MainPart first(coarse);
  coarse = only_main_part(coarse, first);
  const FoundFloor floor = search_floor(coarse);
  if (floor.direction >= 0) coarse = above_floor(coarse, floor);
  const MainPart part(coarse);
  coarse = without_specks(only_main_part(coarse, part));
  VoxelSolidOptions options;
  options.cell = std::max(box_of(coarse).sizes().maxCoeff() / kCellsAlong, 1e-300);
  CoarseBody body{
      VoxelSolid(coarse, options), {}, exact_box(mesh, coarse, cluster, floor), floor.direction, first.share()};
  for (const int cell : body.solid.inside_cells()) body.cells.push_back(body.solid.centre(cell));
  // A surface without an inside is taken as it is.
  if (body.cells.empty()) body.cells = coarse.vertices;
  return body;
}

double UpCues::score() const {
  const double flatness = std::log((flat_below + 0.1) / (flat_above + 0.1));
  return 12.0 * (gap_below - gap_above) + 1.5 * flatness + 10.0 * (balance - 0.5);
}

UpCues up_cues(const CoarseBody& body, int direction) {
  const Vector3d up = axis_direction(direction);
  const Profile profile = profile_along(body, up);
  UpCues cues;
  cues.balance = height_share(body, centre_of(body.cells), up);
  cues.gap_below = static_cast<double>(gap(profile, false)) / kSlices;
  cues.gap_above = static_cast<double>(gap(profile, true)) / kSlices;
  const auto flatness = [&](bool above) {
    return mean_area(profile, 0, 2, above) / std::max(1e-9, mean_area(profile, 5, 8, above));
  };
  cues.flat_below = flatness(false);
  cues.flat_above = flatness(true);
  return cues;
}

std::optional<Facing> find_facing(const CoarseBody& body, int up_direction) {
  const Vector3d up = axis_direction(up_direction);
  const double extent = std::abs((body.box.max() - body.box.min()).dot(up));
  std::vector<Vector3d> feet, ankles, rest;
  for (const Vector3d& cell : body.cells) {
    const double height = height_share(body, cell, up);
    if (height < kFootTop) feet.push_back(cell);
    if (height > kAnkleBottom && height < kAnkleTop) ankles.push_back(cell);
    if (height > kAnkleTop) rest.push_back(cell);
  }
  if (feet.empty() || ankles.empty() || rest.empty()) return std::nullopt;
  Vector3d toes = centre_of(feet) - centre_of(ankles);
  toes -= toes.dot(up) * up;
  Facing facing;
  if (toes.norm() / extent < kMinToeLength) return std::nullopt;
  toes.normalize();

  const Vector3d centre = centre_of(rest);
  const auto turned = [&](double degrees) {
    return Vector3d(Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, up) * toes);
  };
  // The mean of the good directions, because the cells make the overlap jump a little from one to the next.
  double sum = 0.0, weights = 0.0;
  std::vector<std::pair<double, double>> worths;
  for (double degrees = -kSearchTurn; degrees <= kSearchTurn; degrees += 2.0) {
    const double overlap = mirror_overlap(body, rest, centre, up.cross(turned(degrees)));
    worths.emplace_back(overlap - kTurnPenalty * degrees * degrees, degrees);
  }
  const double best = std::max_element(worths.begin(), worths.end())->first;
  for (const auto& [worth, degrees] : worths) {
    const double weight = std::exp((worth - best) / kOverlapNoise);
    sum += weight * degrees;
    weights += weight;
  }
  facing.direction = turned(sum / weights);
  facing.mirror = mirror_overlap(body, rest, centre, up.cross(facing.direction));
  return facing;
}

}  // namespace doppel
