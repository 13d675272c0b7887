#!/usr/bin/env bash
# Builds the site of guides and API pages into build/docs. Installs missing packages. Every warning is an error.
#   scripts/docs.sh                  the first page shows the actor of demo/web, if this folder exists
#   scripts/docs.sh --actor DIR      the first page shows this actor, a folder of `doppel export --format web`
#   scripts/docs.sh --headers FILE   API pages of the headers that FILE lists, one path a line. Without the option: of
#                                    build/release/public_headers.txt, and without this file of all headers
# To look at the site: python3 -m http.server --directory build/docs
set -euo pipefail
cd "$(dirname "$0")/.."

usage() { echo "docs.sh: $1 (allowed: --actor DIR, --headers FILE)" >&2; exit 2; }
actor=''
headers=''
while [ $# -gt 0 ]; do
  case "$1" in
    --actor)
      [ -f "${2:-}/double/description.json" ] ||
        usage "--actor needs a folder of \`doppel export --format web\`, found '${2:-}'"
      actor=$2 ;;
    --headers)
      [ -f "${2:-}" ] || usage "--headers needs a file, found '${2:-}'"
      headers=$2 ;;
    *) usage "unknown argument '$1'" ;;
  esac
  shift 2
done
[ -n "$actor" ] || [ ! -f demo/web/double/description.json ] || actor=demo/web
[ -n "$headers" ] || [ ! -f build/release/public_headers.txt ] || headers=build/release/public_headers.txt

scripts/install_dependencies.sh docs
version=$(sed -n 's/^project(.* VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
site=build/docs
work=build/docs_work
rm -rf "$site" "$work"
mkdir -p "$site" "$work/pages"

list_headers() { if [ -n "$headers" ]; then cat "$headers"; else git ls-files src include | grep '\.h$'; fi; }
{
  cat docs/site/Doxyfile
  printf '%s = "%s"\n' PROJECT_NUMBER "$version" OUTPUT_DIRECTORY "$site" HTML_OUTPUT api GENERATE_TAGFILE "$work/api.tag"
  list_headers | sed 's/.*/INPUT += "&"/'
} | doxygen -
# Doxygen takes the words "file:line" for an address.
find "$site/api" -name '*.html' -exec sed -i 's#<a href="file:[^"]*">\([^<]*\)</a>#\1#g' {} +

# The pages lie as in the tree, so that links between them hold. The first page lies at the root.
for entry in $(git ls-files | cut -d/ -f1 | grep -v '^\.' | sort -u); do ln -s "$PWD/$entry" "$work/pages/"; done
ln -s "$PWD"/docs/site/*.md "$work/pages/"
DOPPEL_API_TAGS="$work/api.tag" /usr/bin/sphinx-build -b html -c docs/site -d "$work/doctrees" -q -W --keep-going \
  -D "html_title=Doppel $version" ${actor:+-t actor} "$work/pages" "$site"
# Debian's furo takes this file from the root of the server.
cp /usr/share/nodejs/normalize.css/normalize.css "$site/_static/styles/"
sed -i 's#/javascript/normalize.css/##' "$site/_static/styles/furo.css"
[ -z "$actor" ] || cp -r "$actor" "$site/actor"
echo "The site is in $site. Look at it with: python3 -m http.server --directory $site"
