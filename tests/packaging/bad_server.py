# SPDX-License-Identifier: BSD-2-Clause
"""Serves the folder "served" with byte ranges, and badly under some names; prints its port.

/cut/FILE breaks off half-way in the first answer, /stop/FILE a thousand bytes on in each; /grown/FILE
says that it is longer than it is in HEAD; /no_ranges/FILE cuts once and always begins at the start.
"""
import http.server
import os

asked = set()


class Handler(http.server.BaseHTTPRequestHandler):
    def answer(self, with_body):
        manner, _, name = self.path.strip("/").rpartition("/")
        path = os.path.join("served", name)
        if not os.path.isfile(path):
            return self.send_error(404)
        with open(path, "rb") as file:
            data = file.read()
        total, start = len(data), 0
        wanted = self.headers.get("Range")
        if wanted and manner != "no_ranges":
            start = int(wanted.split("=")[1].split("-")[0])
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{total - 1}/{total}")
        length = total - start + (7 if manner == "grown" and not with_body else 0)
        self.send_header("Content-Length", str(length))
        self.end_headers()
        if not with_body:
            return
        end = total
        if manner in ("cut", "no_ranges") and self.path not in asked:
            end = total // 2
        if manner == "stop":
            end = min(total, start + 1000)
        asked.add(self.path)
        self.wfile.write(data[start:end])

    def do_GET(self):
        self.answer(True)

    def do_HEAD(self):
        self.answer(False)

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
print(server.server_port, flush=True)
server.serve_forever()
