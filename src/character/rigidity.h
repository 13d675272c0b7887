#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/character/embedded_graph.h"

namespace doppel {

/// Which of the three published tables turns labels into rigidity.
enum class RigidityPreset { livecap, graph, laplacian };
RigidityPreset parse_rigidity_preset(const std::string& word);

/// Label of the LIP human parser per vertex: one integer 0..20 per line. @throws FileError for another count or label.
std::vector<int> read_segmentation(const std::filesystem::path& path, int num_vertices);
void write_segmentation(const std::filesystem::path& path, const std::vector<int>& labels);

/// Rigidity s_i per vertex [N]; 1 everywhere when `labels` is empty. `refinement` divides graph values below 20 by 10.
std::vector<double> vertex_rigidity(const std::vector<int>& labels, int num_vertices, RigidityPreset preset,
                                    bool refinement = false);
/// u_k [K]: the mean of s_i over the vertices node k influences.
std::vector<double> node_rigidity(const std::vector<double>& vertex_rigidity, const EmbeddedGraph& graph);

}  // namespace doppel
