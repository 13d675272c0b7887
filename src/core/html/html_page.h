#pragma once

#include <string>
#include <vector>

namespace doppel {

/// A whole page without references to other files, for screens from a phone's up, light and dark. Charts (`svg_chart`)
/// inside `<div class="charts">` stand side by side. Tables wider than the screen scroll by themselves.
/// @param title plain text, which the function escapes @param body HTML below the title
std::string html_page(const std::string& title, const std::string& body);

/// The result in a sentence, for the top of a page. @param sentence plain text
std::string html_verdict(const std::string& sentence);

/// A figure with its name and, small, what it means.
struct HtmlCard {
  std::string name, value, note;  ///< plain text; the note may be empty
};
/// Figures side by side.
std::string html_cards(const std::vector<HtmlCard>& cards);

/// HTML that is shown when the reader asks for it. @param summary plain text @param body HTML
std::string html_details(const std::string& summary, const std::string& body);

}  // namespace doppel
