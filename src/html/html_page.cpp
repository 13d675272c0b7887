#include "doppel/html/html_page.h"

#include "doppel/html/svg_chart.h"

namespace doppel {
namespace {

constexpr const char* kStyle = R"(
body{font:15px/1.5 system-ui,sans-serif;color:#1e293b;max-width:1180px;margin:2rem auto;padding:0 1rem}
h1{font-size:1.5rem;margin:0}h2{font-size:1.1rem;margin:2rem 0 .6rem;border-bottom:1px solid #e2e8f0}
.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(460px,1fr));gap:1rem}
svg{width:100%;background:#fff;border:1px solid #e2e8f0;border-radius:6px}
svg .title{font:600 13px system-ui}svg .tick{font:11px system-ui;fill:#64748b}svg .grid{stroke:#eef2f7}
table{border-collapse:collapse}td,th{padding:.25rem .8rem;border-bottom:1px solid #e2e8f0;text-align:right}
td:first-child,th:first-child{text-align:left}
.bar{display:inline-block;height:.8em;background:#2563eb;border-radius:2px}
figure{margin:0 0 1rem}figure img{max-width:100%;border-radius:6px}figcaption{color:#64748b;font-size:13px}
pre{background:#f8fafc;border:1px solid #e2e8f0;border-radius:6px;padding:.8rem;overflow:auto;font-size:12.5px}
.muted{color:#64748b})";

}  // namespace

std::string html_page(const std::string& title, const std::string& body) {
  const std::string name = escape_html(title);
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + name + "</title><style>" +
         kStyle + "</style></head><body><h1>" + name + "</h1>" + body + "</body></html>\n";
}

}  // namespace doppel
