#include "doppel/core/html/html_page.h"

#include "doppel/core/html/svg_chart.h"

namespace doppel {
namespace {

constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--back:light-dark(#fff,#15171a);--card:light-dark(#f8fafc,#1e2126);
--ink:light-dark(#1e293b,#e5e7eb);--soft:light-dark(#64748b,#9aa3ae);--line:light-dark(#e2e8f0,#343a42)}
*{box-sizing:border-box}
body{font:15px/1.5 system-ui,sans-serif;background:var(--back);color:var(--ink);max-width:1180px;margin:2rem auto;
padding:0 1rem;overflow-wrap:anywhere}
h1{font-size:1.5rem;margin:0}h2{font-size:1.1rem;margin:2rem 0 .6rem;border-bottom:1px solid var(--line)}
.verdict{font-size:1.15rem;margin:.5rem 0 1rem}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:.8rem;margin:1rem 0}
.card{background:var(--card);border:1px solid var(--line);border-radius:10px;padding:.7rem .9rem}
.card b{display:block;font-size:1.35rem;font-variant-numeric:tabular-nums}.card span{color:var(--soft);font-size:13px}
.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(460px,100%),1fr));gap:1rem}
svg{width:100%;background:var(--card);border:1px solid var(--line);border-radius:6px}svg text{fill:var(--ink)}
svg .title{font:600 13px system-ui}svg .tick{font:11px system-ui;fill:var(--soft)}
svg .grid{stroke:var(--line)}
table{border-collapse:collapse;display:block;max-width:100%;overflow-x:auto;overflow-wrap:normal}
td,th{padding:.25rem .8rem;border-bottom:1px solid var(--line);text-align:right;font-variant-numeric:tabular-nums}
td:first-child,th:first-child{text-align:left}
.bar{display:inline-block;height:.8em;background:#2563eb;border-radius:2px}
figure{margin:0 0 1rem}figure img{max-width:100%;border-radius:6px}figcaption{color:var(--soft);font-size:13px}
details{margin:1rem 0}summary{cursor:pointer;color:var(--soft)}
pre{background:var(--card);border:1px solid var(--line);border-radius:6px;padding:.8rem;overflow:auto;font-size:12.5px;
overflow-wrap:normal}
.muted{color:var(--soft)})";

}  // namespace

std::string html_page(const std::string& title, const std::string& body) {
  const std::string name = escape_html(title);
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
         "content=\"width=device-width, initial-scale=1\"><link rel=\"icon\" href=\"data:,\"><title>" +
         name + "</title><style>" + kStyle + "</style></head><body><h1>" + name + "</h1>" + body + "</body></html>\n";
}

std::string html_verdict(const std::string& sentence) {
  return "<p class=\"verdict\">" + escape_html(sentence) + "</p>";
}

std::string html_cards(const std::vector<HtmlCard>& cards) {
  std::string out;
  for (const HtmlCard& card : cards)
    out += "<div class=\"card\"><span>" + escape_html(card.name) + "</span><b>" + escape_html(card.value) +
           "</b><span>" + escape_html(card.note) + "</span></div>";
  return cards.empty() ? "" : "<div class=\"cards\">" + out + "</div>";
}

std::string html_details(const std::string& summary, const std::string& body) {
  return "<details><summary>" + escape_html(summary) + "</summary>" + body + "</details>";
}

}  // namespace doppel
