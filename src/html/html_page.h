#pragma once

#include <string>

namespace doppel {

/// A whole page without references to other files. Charts (`svg_chart`) inside `<div class="charts">` stand side by
/// side. @param title plain text, which the function escapes @param body HTML below the title
std::string html_page(const std::string& title, const std::string& body);

}  // namespace doppel
