// SPDX-License-Identifier: BSD-2-Clause
// Uses pmsp_web the way a SLAM outside the project does: a live map has an address in a browser.
#include <iostream>

#include <pmsp/live.h>
#include <pmsp/web.h>

int main() {
  const pmsp::LiveDensifier live{pmsp::LiveOptions{}};
  const pmsp::LiveServer server({}, live);
  std::cout << server.url() << "\n";
  return server.url().rfind("http://127.0.0.1:", 0) == 0 ? 0 : 1;
}
