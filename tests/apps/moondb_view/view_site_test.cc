#include "apps/moondb_view/view_site.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>

namespace moondb {
namespace {

using testing::HasSubstr;

class ViewSiteTest : public testing::Test {
 protected:
  std::future<HttpResponse> Begin(const HttpRequest& request) {
    auto promise = std::make_shared<std::promise<HttpResponse>>();
    site_.Handle(request, [promise](HttpResponse response) { promise->set_value(std::move(response)); });
    return promise->get_future();
  }
  HttpResponse Get(const std::string& path, std::map<std::string, std::string> query = {}) {
    return Begin({"GET", path, std::move(query), "", ""}).get();
  }

  proto::TeamConfig team_;
  Board board_{"run"};
  ViewSite site_{team_, board_};
};

TEST_F(ViewSiteTest, ServesThePageAndNothingElse) {
  EXPECT_EQ(Get("/").content_type, "text/html; charset=utf-8");
  for (const char* path :
       {"/etc/passwd", "/../../etc/passwd", "/view.html", "/%2e%2e/x", "//", "", "/api/", "/api/../team"}) {
    EXPECT_EQ(Get(path).status, 404u) << path;
  }
  EXPECT_EQ(Begin({"POST", "/", {}, "", ""}).get().status, 405u);
}

TEST_F(ViewSiteTest, ServesPartsAndTiles) {
  EXPECT_EQ(Get("/api/team").status, 404u);
  board_.Set("team", "{}");
  EXPECT_EQ(Get("/api/team").status, 200u);
  board_.BeginMap({50'000, 1, ""});
  board_.SetTile(-1, 2, "\1");
  EXPECT_EQ(Inflate(*Get("/tiles", {{"map", "2"}, {"at", "-1,2;7,7"}}).body).value().size(), 9u);
  EXPECT_EQ(Inflate(*Get("/tiles", {{"map", "2"}, {"at", "7,7"}}).body).value(), "");
  for (const char* at : {"", "x", "1", "1,", "99999999999999999999,1", "nan,1"}) {
    EXPECT_EQ(Get("/tiles", {{"map", "2"}, {"at", at}}).status, 400u) << at;
  }
  EXPECT_EQ(Get("/tiles", {{"at", "-1,2"}}).status, 400u);
}

TEST_F(ViewSiteTest, ARequestForChangesWaitsForOne) {
  board_.Set("team", "{}");
  EXPECT_THAT(*Get("/api/changes", {{"since", "0"}}).body, HasSubstr(R"("team":1)"));
  auto waits = Begin({"GET", "/api/changes", {{"since", "1"}}, "", ""});
  EXPECT_EQ(waits.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  board_.Set("poses", "{}");
  EXPECT_THAT(*waits.get().body, HasSubstr(R"("resources":{"poses":2})"));
  EXPECT_EQ(Get("/api/changes", {{"since", "-1"}}).status, 400u);
  EXPECT_EQ(Get("/api/changes").status, 400u);
}

TEST_F(ViewSiteTest, CountsItsViewers) {
  EXPECT_EQ(site_.viewers(), 0u);
  auto first = Begin({"GET", "/api/changes", {{"since", "0"}}, "", ""});
  auto second = Begin({"GET", "/api/changes", {{"since", "0"}}, "", ""});
  EXPECT_EQ(site_.viewers(), 2u);
  board_.Set("team", "{}");
  (void)first.get();
  (void)second.get();
  EXPECT_EQ(site_.viewers(), 2u) << "they ask again at once";
}

TEST_F(ViewSiteTest, DropsRequestsThatWaitAtItsEnd) {
  auto waits = Begin({"GET", "/api/changes", {{"since", "0"}}, "", ""});
  site_.End();
  EXPECT_THROW((void)waits.get(), std::future_error);
  auto late = Begin({"GET", "/api/changes", {{"since", "0"}}, "", ""});
  EXPECT_THROW((void)late.get(), std::future_error);
}

TEST_F(ViewSiteTest, RefusesQuestionsThatMakeNoSense) {
  EXPECT_EQ(Get("/api/why", {{"x", "1"}}).status, 400u);
  EXPECT_EQ(Get("/api/why", {{"x", "1"}, {"y", "west"}}).status, 400u);
  EXPECT_EQ(Get("/api/why", {{"x", "1"}, {"y", "2"}}).status, 503u) << "no agent is watched";
  const std::string on = R"({"is_on":true})";
  EXPECT_EQ(Begin({"GET", "/api/ask", {}, "application/json", on}).get().status, 400u);
  EXPECT_EQ(Begin({"POST", "/api/ask", {}, "text/plain", on}).get().status, 400u) << "a form of another site";
  EXPECT_EQ(Begin({"POST", "/api/ask", {}, "application/json", "{}"}).get().status, 400u);
  EXPECT_EQ(Begin({"POST", "/api/ask", {}, "application/json", on}).get().status, 503u);
}

}  // namespace
}  // namespace moondb
