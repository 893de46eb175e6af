"""Requires that every link between the pages of a book, and out of it to files, leads somewhere."""

import html.parser
import pathlib
import sys
import urllib.parse


class Page(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id":
                self.anchors.add(value)
            elif name in ("href", "src") and value:
                self.links.append(value)


book = pathlib.Path(sys.argv[1])
# The page for addresses that do not exist has links from the root of a server.
pages = {path.name: Page(path) for path in book.glob("*.html") if path.name != "404.html"}
broken = []
for name, page in pages.items():
    for link in page.links:
        url = urllib.parse.urlsplit(link)
        target = book / (urllib.parse.unquote(url.path) or name)
        anchors = pages[target.name].anchors if target.name in pages else {url.fragment}
        if not url.scheme and (not target.exists() or url.fragment and url.fragment not in anchors):
            broken.append(f"{name}: {link}")
if not pages or broken:
    sys.exit("\n".join(broken) or f"{book} has no pages")
print(f"{len(pages)} pages, every link leads somewhere")
