#include "house/include_floors.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <stdexcept>

namespace doppel::house {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, int> kFloors = {
    {"core", 0}, {"geometry", 1}, {"character", 2}, {"layers", 3}, {"render", 3}, {"data", 4}, {"losses", 4},
    {"nets", 4}, {"train", 5},    {"eval", 5},      {"track", 6},  {"export", 6}, {"tools", 7}};

struct Include {
  std::string target;  // "doppel/core/error.h", or relative to src/ after resolving
  int line = 0;
};

bool is_source(const fs::path& path) {
  static const std::set<std::string> kExtensions{".h", ".hpp", ".inl", ".cpp", ".cc"};
  return kExtensions.count(path.extension().string()) != 0;
}

std::vector<fs::path> sources(const fs::path& tree) {
  std::vector<fs::path> found;
  for (const char* folder : {"src/doppel", "tools"}) {
    if (!fs::exists(tree / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(tree / folder)) {
      if (entry.is_regular_file() && is_source(entry.path())) found.push_back(entry.path().lexically_relative(tree));
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// "src/doppel/core/error.h" -> "core"; "tools/main.cpp" -> "tools".
std::string room_of(const fs::path& file) {
  auto part = file.begin();
  if (*part == "tools") return "tools";
  std::advance(part, 2);
  return part->string();
}

std::vector<Include> includes_of(const fs::path& path) {
  static const std::regex kInclude(R"re(^\s*#\s*include\s*["<]([^">]+)[">])re");
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  std::vector<Include> includes;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::smatch match;
    if (std::regex_search(line, match, kInclude)) includes.push_back({match[1], number});
  }
  return includes;
}

std::string described(const std::string& room, int floor) { return room + " (floor " + std::to_string(floor) + ")"; }

/// What is wrong with an include of `target` (a path relative to the tree), or "".
std::string fault_of_edge(const std::string& room, const fs::path& target, const fs::path& tree) {
  if (!fs::exists(tree / target)) return "includes " + target.string() + ", which is not there";
  const std::string other = room_of(target);
  const auto from = kFloors.find(room), to = kFloors.find(other);
  if (from == kFloors.end()) return "the room " + room + " has no floor";
  if (to == kFloors.end()) return "includes the room " + other + ", which has no floor";
  if (room == other || to->second < from->second) return "";
  const std::string way = to->second > from->second ? " upwards" : " sideways";
  return described(room, from->second) + " includes" + way + " " + described(other, to->second) + ": " +
         target.string();
}

/// Where the include leads inside the tree; empty for everyone else's headers.
fs::path target_in_tree(const fs::path& file, const std::string& written, const fs::path& tree) {
  if (written.rfind("doppel/", 0) == 0) return fs::path("src") / written;
  for (const fs::path& candidate : {file.parent_path() / written, fs::path(written)}) {
    const fs::path normal = candidate.lexically_normal();
    const bool ours = *normal.begin() == "tools" || (*normal.begin() == "src" && fs::exists(tree / normal));
    if (ours && fs::exists(tree / normal)) return normal;
  }
  return {};
}

/// Walks the includes depth first; a file met again on the way down closes a circle.
class CircleFinder {
 public:
  using Graph = std::map<fs::path, std::vector<std::pair<fs::path, int>>>;
  explicit CircleFinder(const Graph& graph) : graph_(graph) {}

  std::vector<Violation> find() {
    for (const auto& [file, edges] : graph_) visit(file);
    return found_;
  }

 private:
  void visit(const fs::path& file) {
    if (!done_.insert(file).second) return;
    way_.push_back(file);
    const auto edges = graph_.find(file);
    if (edges != graph_.end()) {
      for (const auto& [target, line] : edges->second) {
        const auto start = std::find(way_.begin(), way_.end(), target);
        if (start == way_.end()) {
          visit(target);
          continue;
        }
        std::string circle;
        for (auto step = start; step != way_.end(); ++step) circle += step->string() + " -> ";
        found_.push_back({file, line, "includes in a circle: " + circle + target.string()});
      }
    }
    way_.pop_back();
  }

  const Graph& graph_;
  std::set<fs::path> done_;
  std::vector<fs::path> way_;
  std::vector<Violation> found_;
};

}  // namespace

std::vector<Violation> check_includes(const fs::path& tree) {
  std::vector<Violation> violations;
  CircleFinder::Graph graph;
  for (const fs::path& file : sources(tree)) {
    for (const Include& include : includes_of(tree / file)) {
      const fs::path target = target_in_tree(file, include.target, tree);
      if (target.empty()) continue;
      const std::string fault = fault_of_edge(room_of(file), target, tree);
      if (!fault.empty()) violations.push_back({file, include.line, fault});
      graph[file].emplace_back(target, include.line);
    }
  }
  for (Violation& circle : CircleFinder(graph).find()) violations.push_back(std::move(circle));
  return violations;
}

std::size_t count_sources(const fs::path& tree) { return sources(tree).size(); }

}  // namespace doppel::house
