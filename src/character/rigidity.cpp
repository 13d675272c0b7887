#include "doppel/character/rigidity.h"

#include "doppel/character/labels.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

using Table = std::array<double, kNumLabels>;

// One value per label. Only the third table has a value for the body under a dress (20); the others use that of dress.
// clang-format off
//                             0   1    2    3    4    5   6   7   8   9    10  11  12  13   14   15   16   17   18   19   20
constexpr Table kLiveCap   = {1,  100, 200, 100, 200, 2,  1,  1,  50, 2.5, 1,  3,  1,  200, 50,  50,  50,  50,  100, 100, 1};
constexpr Table kGraph     = {10, 200, 200, 200, 200, 10, 10, 10, 50, 15,  10, 50, 10, 200, 200, 200, 200, 200, 200, 200, 10};
constexpr Table kLaplacian = {1,  5,   400, 5,   5,   1,  1,  1,  1,  2,   1,  1,  1,  400, 5,   5,   5,   5,   5,   5,   0.25};
// clang-format on

const Table& table_of(RigidityPreset preset) {
  switch (preset) {
    case RigidityPreset::livecap:
      return kLiveCap;
    case RigidityPreset::laplacian:
      return kLaplacian;
    case RigidityPreset::graph:
      break;
  }
  return kGraph;
}

/// Graph values below this are clothing, which the in-the-wild refinement makes ten times less rigid.
constexpr double kClothing = 20.0;

}  // namespace

const std::array<std::string, kNumLabels>& label_names() {
  static const std::array<std::string, kNumLabels> names{
      "background", "hat",       "hair",     "glove",     "sunglasses", "upper_clothes", "dress",
      "coat",       "socks",     "pants",    "jumpsuit",  "scarf",      "skirt",         "face",
      "left_arm",   "right_arm", "left_leg", "right_leg", "left_shoe",  "right_shoe",    "under_dress"};
  return names;
}

RigidityPreset parse_rigidity_preset(const std::string& word) {
  if (word == "livecap") return RigidityPreset::livecap;
  if (word == "graph") return RigidityPreset::graph;
  if (word == "laplacian") return RigidityPreset::laplacian;
  fail<UsageError>("rigidity '{}' is not known; choose livecap, graph or laplacian", word);
}

std::vector<int> read_segmentation(const std::filesystem::path& path, int num_vertices) {
  TextReader reader(path, "a segmentation file");
  std::vector<int> labels;
  while (reader.next_line()) {
    if (reader.tokens().size() != 1)
      reader.fail_here("a line holds one label, this one has {} columns", reader.tokens().size());
    labels.push_back(static_cast<int>(reader.integer(0, "label", 0, kNumLabels - 1)));
  }
  if (static_cast<int>(labels.size()) != num_vertices)
    fail_at({path.string(), 0}, "the file has {} labels, but the mesh has {} vertices; one line per vertex is needed",
            labels.size(), num_vertices);
  return labels;
}

void write_segmentation(const std::filesystem::path& path, const std::vector<int>& labels) {
  std::string text;
  for (const int label : labels) text += std::to_string(label) + "\n";
  write_atomically(path, text);
}

std::vector<double> vertex_rigidity(const std::vector<int>& labels, int num_vertices, RigidityPreset preset,
                                    bool refinement) {
  std::vector<double> rigidity(num_vertices, 1.0);
  if (labels.empty()) return rigidity;
  if (static_cast<int>(labels.size()) != num_vertices)
    fail("rigidity needs a label for each of {} vertices, received {}", num_vertices, labels.size());
  const Table& table = table_of(preset);
  for (int v = 0; v < num_vertices; ++v) {
    if (labels[v] < 0 || labels[v] >= kNumLabels) fail("label {} of vertex {} is not one of 0..20", labels[v], v);
    rigidity[v] = table[labels[v]];
    if (refinement && preset == RigidityPreset::graph && rigidity[v] < kClothing) rigidity[v] /= 10.0;
  }
  return rigidity;
}

std::vector<double> node_rigidity(const std::vector<double>& vertex_values, const EmbeddedGraph& graph) {
  if (static_cast<int>(vertex_values.size()) != graph.vertex_nodes.num_rows())
    fail("rigidity is given for {} vertices, but the graph moves {}", vertex_values.size(),
         graph.vertex_nodes.num_rows());
  std::vector<double> sum(graph.num_nodes(), 0.0);
  std::vector<int> count(graph.num_nodes(), 0);
  for (int v = 0; v < graph.vertex_nodes.num_rows(); ++v)
    for (const int k : graph.vertex_nodes.row(v)) {
      sum[k] += vertex_values[v];
      ++count[k];
    }
  // A node always influences its own vertex. Only a graph built by hand can have a node without vertices.
  for (int k = 0; k < graph.num_nodes(); ++k) sum[k] = count[k] > 0 ? sum[k] / count[k] : 1.0;
  return sum;
}

}  // namespace doppel
