// SPDX-License-Identifier: BSD-2-Clause
//
// The page of `bench` in a real browser, used as a reader does (page_check.js).
#include "cli_fixture.hpp"

namespace stillpoint {
namespace {

class Page : public Cli {
 protected:
  static bool has_browser() { return std::system("command -v chromium >/dev/null 2>&1") == 0; }

  /// What page_check.js found on a page: "charts N, tables N, problems N" and the problems.
  static std::string check(const fs::path& page, const std::string& window) {
    std::string html = text_of(page);
    const auto put = [&](const std::string& before, const std::string& script, bool last) {
      const std::size_t at = last ? html.rfind(before) : html.find(before);
      EXPECT_NE(at, std::string::npos) << before;
      html.insert(at, "<script>" + script + "</script>\n");
    };
    put("<meta charset",
        // No frames are made for a page that nobody looks at.
        "window.problems = []; window.requestAnimationFrame = (f) => setTimeout(() => "
        "f(performance.now()), 0); window.addEventListener('error', (e) => "
        "window.problems.push(String(e.message ?? e.target)), true);"
        "for (const kind of ['error', 'warn']) { const say = console[kind]; console[kind] = (...a) "
        "=> "
        "{ window.problems.push(a.join(' ')); say(...a); }; }",
        false);
    put("</body>", text_of(STILLPOINT_PAGE_CHECK), true);
    const fs::path checked = page.parent_path() / "checked.html";
    std::ofstream(checked) << html;
    const fs::path found = page.parent_path() / "found.html";
    // A profile of its own, and nothing that asks the network.
    const std::string command =
        "timeout 300 chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run "
        "--disable-background-networking --disable-component-update --disable-sync "
        "--user-data-dir='" +
        (page.parent_path() / "profile").string() + "' --window-size=" + window +
        " --virtual-time-budget=120000 --dump-dom 'file://" + checked.string() + "' >'" +
        found.string() + "' 2>/dev/null";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    const std::string dom = text_of(found), begin = "<pre id=\"checked\">";
    const std::size_t at = dom.find(begin);
    return at == std::string::npos
               ? "page_check.js did not come to its end"
               : dom.substr(at + begin.size(), dom.find("</pre>", at) - at - begin.size());
  }
};

TEST_F(Page, WorksInABrowserOnADeskAndOnAPhone) {
  if (!has_browser()) GTEST_SKIP() << "chromium is not installed (apt-get install chromium)";
  ASSERT_EQ(
      run("bench walk --out shown --tracker vo --variants off,paper,network_only,default,truth "
          "--vary dilation_px=0,10")
          .code,
      0);
  const fs::path page = path("shown") / "index.html";
  ASSERT_NE(text_of(page).find("Chart.js v"), std::string::npos)
      << "built without Chart.js (apt-get install libjs-chart.js)";
  // One chart of all sequences, two of paths, four of time, one of stages, three of the setting;
  // the summary, accuracy, masks, times.
  for (const char* window : {"1280,900", "390,800"})
    EXPECT_EQ(check(page, window), "charts 11, tables 4, problems 0\n") << window;
}

// Without Chart.js the page has its tables, says what is missing, and nothing breaks.
TEST_F(Page, WithoutTheLibraryItHasItsTables) {
  if (!has_browser()) GTEST_SKIP() << "chromium is not installed (apt-get install chromium)";
  ASSERT_EQ(run("bench walk --out bare --tracker vo --frames 6 --variants off,default").code, 0);
  std::string html = text_of(path("bare") / "index.html");
  const std::size_t begin = html.find("<script>", html.find("id=\"charts\"")),
                    end = html.find("</script>", begin);
  ASSERT_NE(begin, std::string::npos);
  html.erase(begin, end - begin);
  html.insert(begin, "<script>");
  fs::create_directories(path("bare") / "page");
  std::ofstream(path("bare") / "page" / "index.html") << html;
  EXPECT_EQ(check(path("bare") / "page" / "index.html", "1280,900"),
            "charts 0, tables 4, problems 0\n");
}

TEST_F(Page, ItsChartsBecomeAPictureForDocuments) {
  const std::string script = "/usr/bin/python3 '" STILLPOINT_ROOT "/scripts/draw_charts' ";
  if (std::system("/usr/bin/python3 -c 'import matplotlib' 2>/dev/null") != 0)
    GTEST_SKIP() << "matplotlib is not installed (apt-get install python3-matplotlib)";
  ASSERT_EQ(run("bench walk --out drawn --tracker vo --frames 6 --variants off --vary "
                "dilation_px=0,10")
                .code,
            0);
  const auto draw = [&](const std::string& group, const std::string& name) {
    return std::system((script + path("drawn").string() + "/index.html " + group + " " +
                        path(name).string() + " 2>/dev/null")
                           .c_str());
  };
  ASSERT_EQ(draw("settings", "first.svg"), 0);
  ASSERT_EQ(draw("settings", "second.svg"), 0);
  EXPECT_NE(text_of(path("first.svg")).find("dilation_px"), std::string::npos);
  EXPECT_EQ(text_of(path("first.svg")), text_of(path("second.svg")));
  EXPECT_NE(draw("nothing", "third.svg"), 0);
  EXPECT_FALSE(fs::exists(path("third.svg")));
}

}  // namespace
}  // namespace stillpoint
