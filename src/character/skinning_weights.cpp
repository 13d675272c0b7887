#include "doppel/character/skinning_weights.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <numeric>
#include <set>

#include "doppel/character/file_text.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

constexpr char kWeightsHeader[] = "Skeletool character skinning file V1.0";
/// Tolerance of the sum of weights around 1: ten of them may be rounded to three decimals.
constexpr double kSumTolerance = 5e-3;
/// Tolerance of a single weight above 1.
constexpr double kWeightSlack = 1e-6;

/// One vertex line. `stripped` holds the weights without the vertex index that some files append to them.
struct VertexLine {
  int vertex = 0;
  std::vector<int> bones;
  std::vector<double> plain, stripped;
  FileLocation where;
};

/// The weight before a glued vertex index: `0.54185910` of vertex 10 is 0.541859.
std::optional<double> strip_index(std::string_view token, const std::string& index) {
  if (token.size() <= index.size() || token.substr(token.size() - index.size()) != index) return std::nullopt;
  return parse_number(token.substr(0, token.size() - index.size()));
}

std::vector<std::string> read_bones(TextReader& reader) {
  reader.require_line("the line 'bones:'");
  if (reader.line() != "bones:") reader.fail_here("expected the line 'bones:', found '{}'", excerpt(reader.line()));
  reader.require_line("the line of bone names");
  if (reader.line() == "vertex weights:") reader.fail_here("the list of bones is empty; at least one is needed");
  std::vector<std::string> bones(reader.tokens().begin(), reader.tokens().end());
  std::set<std::string> seen;
  for (const std::string& bone : bones)
    if (!seen.insert(bone).second)
      reader.fail_here("the bone '{}' is listed twice; names must be unique", excerpt(bone));
  reader.require_line("the line 'vertex weights:'");
  if (reader.line() != "vertex weights:")
    reader.fail_here("expected the line 'vertex weights:' after the bone names, found '{}'", excerpt(reader.line()));
  return bones;
}

VertexLine read_vertex(const TextReader& reader, int num_bones) {
  VertexLine line;
  line.where = reader.where();
  line.vertex = static_cast<int>(reader.integer(0, "vertex index", 0, INT_MAX - 1));
  const std::string index(reader.tokens()[0]);
  const std::size_t columns = reader.tokens().size();
  if (columns < 3 || columns % 2 == 0)
    reader.fail_here("a vertex line is an index and then pairs of bone and weight; this one has {} columns", columns);
  bool glued = columns > 3;
  for (std::size_t i = 1; i + 1 < columns; i += 2) {
    line.bones.push_back(static_cast<int>(reader.integer(i, "bone index", 0, num_bones - 1)));
    line.plain.push_back(reader.number(i + 1, "weight"));
    line.stripped.push_back(line.plain.back());
    if (i + 3 > columns - 1) continue;  // nothing follows the last weight, so nothing is glued to it
    if (const auto weight = strip_index(reader.tokens()[i + 1], index))
      line.stripped.back() = *weight;
    else
      glued = false;
  }
  if (!glued) line.stripped.clear();
  return line;
}

double sum_error(const std::vector<double>& weights) {
  return std::abs(std::accumulate(weights.begin(), weights.end(), 0.0) - 1.0);
}

/// Whether the whole file has vertex indices glued to the weights: every line that can have one does, and without the
/// indices the sums of the weights are nearer to 1.
bool is_glued(const std::vector<VertexLine>& lines) {
  double plain = 0.0, stripped = 0.0;
  bool any = false;
  for (const VertexLine& line : lines) {
    if (line.plain.size() < 2) continue;
    if (line.stripped.empty()) return false;
    any = true;
    plain = std::max(plain, sum_error(line.plain));
    stripped = std::max(stripped, sum_error(line.stripped));
  }
  return any && stripped < plain;
}

void check_weights(const VertexLine& line, const std::vector<double>& weights) {
  for (const double weight : weights)
    if (weight < 0.0 || weight > 1.0 + kWeightSlack)
      fail_at(line.where, "a weight of vertex {} is {}; weights lie between 0 and 1", line.vertex, weight);
  if (sum_error(weights) > kSumTolerance)
    fail_at(line.where, "the weights of vertex {} sum to {:.4f}; they must sum to 1 within {}", line.vertex,
            std::accumulate(weights.begin(), weights.end(), 0.0), kSumTolerance);
}

/// Appends one vertex to the result: largest weight first, sum 1.
void append_vertex(SkinningWeights& skin, const VertexLine& line, bool glued) {
  std::vector<double> weights = glued && !line.stripped.empty() ? line.stripped : line.plain;
  check_weights(line, weights);
  std::vector<int> order(weights.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return weights[a] > weights[b]; });
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  // Weights that already sum to 1 keep their last digit, so that writing and reading do not change them.
  const double scale = std::abs(sum - 1.0) < 1e-12 ? 1.0 : 1.0 / sum;
  for (const int i : order) {
    skin.vertex_bones.items.push_back(line.bones[i]);
    skin.weights.push_back(weights[i] * scale);
  }
  skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
}

/// Sorts the lines by vertex and checks that each of the N vertices has one.
void order_vertices(const std::filesystem::path& path, std::vector<VertexLine>& lines, int num_vertices) {
  std::stable_sort(lines.begin(), lines.end(), [](const auto& a, const auto& b) { return a.vertex < b.vertex; });
  const int expected = num_vertices > 0 ? num_vertices : static_cast<int>(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i > 0 && lines[i].vertex == lines[i - 1].vertex)
      fail_at(lines[i].where, "vertex {} has a second line of weights", lines[i].vertex);
    if (lines[i].vertex >= expected && num_vertices > 0)
      fail_at(lines[i].where, "vertex index {}, but the mesh has {} vertices", lines[i].vertex, num_vertices);
    if (lines[i].vertex != static_cast<int>(i))
      fail_at({path.string(), 0}, "vertex {} has no line of weights; each of the mesh's vertices needs one", i);
  }
  if (static_cast<int>(lines.size()) != expected || lines.empty())
    fail_at({path.string(), 0}, "the file has weights for {} vertices, but {} are needed", lines.size(),
            num_vertices > 0 ? std::to_string(num_vertices) : std::string("some"));
}

}  // namespace

SkinningWeights read_skin(const std::filesystem::path& path, int num_vertices) {
  TextReader reader(path, "a skinning file");
  require_version(reader, kWeightsHeader, "skinning", "skinning file");
  SkinningWeights skin;
  skin.bones = read_bones(reader);
  std::vector<VertexLine> lines;
  while (reader.next_line()) lines.push_back(read_vertex(reader, skin.num_bones()));
  order_vertices(path, lines, num_vertices);
  skin.repaired = is_glued(lines);
  for (const VertexLine& line : lines) append_vertex(skin, line, skin.repaired);
  return skin;
}

void write_skin(const std::filesystem::path& path, const SkinningWeights& skin) {
  std::string text = std::string(kWeightsHeader) + "\nbones:\n";
  for (const std::string& bone : skin.bones) text += " " + bone;
  text += "\nvertex weights:\n";
  for (int v = 0; v < skin.num_vertices(); ++v) {
    text += std::to_string(v);
    for (int i = skin.vertex_bones.offsets[v]; i < skin.vertex_bones.offsets[v + 1]; ++i)
      text += fmt::format(" {} {}", skin.vertex_bones.items[i], exact_text(skin.weights[i]));
    text += "\n";
  }
  write_atomically(path, text);
}

}  // namespace doppel
