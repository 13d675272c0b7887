#include "levels/include_levels.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <stdexcept>

namespace doppel::levels {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, int> kLevels = {
    {"core", 0},   {"distributed", 1}, {"geometry", 1}, {"solver", 1}, {"calibration", 2}, {"character", 2},
    {"render", 2}, {"detect", 3},      {"layers", 3},   {"data", 4},   {"io", 4},          {"losses", 4},
    {"nets", 4},   {"actor", 5},       {"rigging", 5},  {"eval", 6},   {"synth", 6},       {"track", 7},
    {"train", 7},  {"view", 8},        {"tools", 9}};

struct Include {
  std::string target;  // as written: "doppel/core/error.h"
  int line = 0;
};

bool is_source(const fs::path& path) {
  static const std::set<std::string> kExtensions{".h", ".hpp", ".inl", ".cpp", ".cc"};
  return kExtensions.count(path.extension().string()) != 0;
}

std::vector<fs::path> sources(const fs::path& tree, const std::vector<std::string>& folders = {"src", "tools"}) {
  std::vector<fs::path> found;
  for (const std::string& folder : folders) {
    if (!fs::exists(tree / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(tree / folder)) {
      if (entry.is_regular_file() && is_source(entry.path())) found.push_back(entry.path().lexically_relative(tree));
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// "src/core/error.h" -> "core"; "tools/main.cpp" -> "tools".
std::string module_of(const fs::path& file) {
  auto part = file.begin();
  if (*part != "src") return part->string();
  std::advance(part, 1);
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
    if (line.find("include") != std::string::npos && std::regex_search(line, match, kInclude))
      includes.push_back({match[1], number});
  }
  return includes;
}

std::string described(const std::string& module, int level) {
  return module + " (level " + std::to_string(level) + ")";
}

/// What is wrong with an include of `target` (a path relative to the tree), or "".
std::string fault_of_include(const std::string& module, const fs::path& target, const fs::path& tree) {
  if (!fs::exists(tree / target)) return "includes " + target.string() + ", which is not there";
  const std::string other = module_of(target);
  const auto from = kLevels.find(module), to = kLevels.find(other);
  if (from == kLevels.end()) return "the module " + module + " has no level";
  if (to == kLevels.end()) return "includes the module " + other + ", which has no level";
  if (module == other || to->second < from->second) return "";
  const std::string way = to->second > from->second ? " upwards" : " sideways";
  return described(module, from->second) + " includes" + way + " " + described(other, to->second) + ": " +
         target.string();
}

/// Where the include leads inside the tree; empty for everyone else's headers.
fs::path target_in_tree(const fs::path& file, const std::string& written, const fs::path& tree) {
  if (written.rfind("doppel/", 0) == 0) return fs::path("src") / written.substr(7);
  for (const fs::path& candidate : {file.parent_path() / written, fs::path(written)}) {
    const fs::path normal = candidate.lexically_normal();
    const bool ours = *normal.begin() == "tools" || (*normal.begin() == "src" && fs::exists(tree / normal));
    if (ours && fs::exists(tree / normal)) return normal;
  }
  return {};
}

/// The headers that modules offer, as paths in the tree.
struct Doors {
  std::set<fs::path> open, shared;  // PUBLIC_HEADERS, SHARED_HEADERS
};

Doors read_doors(const fs::path& tree) {
  Doors doors;
  for (const auto& [module, level] : kLevels) {
    std::ifstream list(tree / "src" / module / "CMakeLists.txt");
    std::set<fs::path>* headers = nullptr;
    for (std::string word; list >> word;) {
      if (word == "PUBLIC_HEADERS") {
        headers = &doors.open;
      } else if (word == "SHARED_HEADERS") {
        headers = &doors.shared;
      } else if (headers != nullptr && word.find(".h") != std::string::npos) {
        headers->insert(fs::path("src") / module / word.substr(0, word.find(".h") + 2));  // without a last bracket
      } else {
        headers = nullptr;
      }
    }
  }
  return doors;
}

/// A header and its source are one node: "src/core/log". An edge remembers the include it comes from.
struct Edge {
  fs::path target, file;
  int line = 0;
};

fs::path pair_of(fs::path file) { return file.replace_extension(); }

/// Walks the includes depth first; a pair met again on the way down closes a circle.
class CircleFinder {
 public:
  using Graph = std::map<fs::path, std::vector<Edge>>;
  explicit CircleFinder(const Graph& graph) : graph_(graph) {}

  std::vector<Violation> find() {
    for (const auto& [pair, edges] : graph_) visit(pair);
    return found_;
  }

 private:
  void visit(const fs::path& pair) {
    if (!done_.insert(pair).second) return;
    way_.push_back(pair);
    const auto edges = graph_.find(pair);
    if (edges != graph_.end())
      for (const Edge& edge : edges->second) follow(edge);
    way_.pop_back();
  }

  void follow(const Edge& edge) {
    const auto start = std::find(way_.begin(), way_.end(), edge.target);
    if (start == way_.end()) return visit(edge.target);
    std::string circle;
    for (auto step = start; step != way_.end(); ++step) circle += step->string() + " -> ";
    found_.push_back({edge.file, edge.line, "includes in a circle: " + circle + edge.target.string()});
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
      const std::string fault = fault_of_include(module_of(file), target, tree);
      if (!fault.empty()) violations.push_back({file, include.line, fault});
      if (target == file || pair_of(target) != pair_of(file))
        graph[pair_of(file)].push_back({pair_of(target), file, include.line});
    }
  }
  for (Violation& circle : CircleFinder(graph).find()) violations.push_back(std::move(circle));
  return violations;
}

std::vector<Violation> check_headers(const fs::path& tree) {
  const Doors doors = read_doors(tree);
  std::vector<Violation> violations;
  std::set<fs::path> used;
  const auto check = [&](const fs::path& file, bool outside) {
    const bool in_public = doors.open.count(file) != 0;
    for (const Include& include : includes_of(tree / file)) {
      const fs::path target = target_in_tree(file, include.target, tree);
      if (target.empty() || *target.begin() != "src" || doors.open.count(target) != 0) continue;
      if (!fs::exists(tree / target)) continue;  // check_includes reports those that are not there
      const bool own = !outside && module_of(file) == module_of(target);
      if (!own) used.insert(target);
      const bool shared = doors.shared.count(target) != 0;
      const std::string kind = shared ? "a shared header" : "a private header";
      if (outside) {
        violations.push_back({file, include.line, "includes " + kind + ": " + target.string()});
      } else if (in_public) {
        violations.push_back({file, include.line, "is public and includes " + kind + ": " + target.string()});
      } else if (!own && !shared) {
        violations.push_back({file, include.line, "includes a private header of another module: " + target.string()});
      }
    }
  };
  for (const fs::path& file : sources(tree, {"src", "tools", "shared_library"})) check(file, false);
  for (const fs::path& file : sources(tree, {"examples", "python", "tests/install"})) check(file, true);
  for (const fs::path& header : doors.shared)
    if (used.count(header) == 0) violations.push_back({header, 0, "is shared, but no other module includes it"});
  return violations;
}

std::size_t count_sources(const fs::path& tree) { return sources(tree).size(); }

}  // namespace doppel::levels
