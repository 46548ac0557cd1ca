#!/usr/bin/env bash
# Builds the site of the documentation into build/site/html: all pages, the gallery (about a minute on one core), and references of Python and
# C++. Warnings are errors. Needs the program and the Python module (scripts/build.sh) and the packages below.
#   scripts/site.sh [--skip-gallery]     --skip-gallery: pages of the gallery without runs and pictures
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

packages=(python3-sphinx python3-myst-parser python3-sphinx-gallery python3-breathe doxygen)
for package in "${packages[@]}"; do
  dpkg-query -W "$package" >/dev/null 2>&1 || die "missing package $package; apt-get install ${packages[*]}"
done
[[ -d $build/python/pliant ]] || die "$build/python does not exist; run scripts/build.sh"
case ${1:-} in
  "") ;;
  --skip-gallery) export PLIANT_GALLERY=skip ;;
  *) die "unknown argument $1; usage: scripts/site.sh [--skip-gallery]" ;;
esac

say "Checking links and commands of the pages"
/usr/bin/python3 -B "$root/scripts/check_links.py"
/usr/bin/python3 -B "$root/scripts/check_commands.py"

site=$build/site
source=$site/source
rm -rf "$site"
mkdir -p "$source"
PLIANT_VERSION=$(sed -n 's/^project(pliant VERSION \([0-9.]*\).*/\1/p' "$root/CMakeLists.txt")
export PLIANT_VERSION PLIANT_DOXYGEN_XML=$site/doxygen/xml
cp -r "$root"/*.md "$root"/{LICENSE,CITATION.cff,docs,examples} "$source"
(cd "$root" && find src \( -name README.md -o -path src/model/term.h \) -exec cp --parents {} "$source" \;)
mv "$source"/docs/site/{python,cpp}.rst "$source"
say "Reading the headers with doxygen"
mkdir -p "$site/doxygen"
(cd "$root" && { cat Doxyfile; printf '%s\n' "OUTPUT_DIRECTORY = $site/doxygen" 'GENERATE_HTML = NO' 'GENERATE_XML = YES' 'XML_PROGRAMLISTING = NO'; } | doxygen -)

export PYTHONPATH=$build/python PATH=$build/apps:$build/examples/own_term:$PATH
export OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
/usr/bin/python3 -B -m sphinx -q -W --keep-going -b html -c "$root/docs/site" -d "$site/doctrees" "$source" "$site/html"
mkdir -p "$site/html/docs"
cp -r "$root/docs/images" "$site/html/docs"  # for tags <img> of pages
printf '<meta http-equiv="refresh" content="0; url=docs/README.html">\n' >"$site/html/index.html"
say "wrote build/site/html/index.html"
