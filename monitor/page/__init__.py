"""The live page: a small web server, and the static files of the page."""
