#include "client/endpoint.h"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>

#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using ::testing::HasSubstr;

// A process that listens at a socket.
class Listener {
 public:
  explicit Listener(const std::filesystem::path& path) : file_(::socket(AF_UNIX, SOCK_STREAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(file_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(file_, 1), 0);
  }
  ~Listener() { ::close(file_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

 private:
  const int file_;
};

class EndpointTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(::setenv("MOONDB_RUN_DIR", run_.c_str(), 1), 0);
    MakePrivate(run_ / "moon-00112233");
    MakePrivate(data_);
  }
  void TearDown() override { ::unsetenv("MOONDB_RUN_DIR"); }
  static void MakePrivate(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all);
  }
  void Report(const std::filesystem::path& socket) {
    std::ofstream(data_ / kEndpointFile) << kIpcScheme << socket.string() << "\n";
  }

  const TemporaryFolder folder_;
  const std::filesystem::path run_ = folder_.path() / "run";
  const std::filesystem::path data_ = folder_.path() / "data";
  const AgentOfTeam agent_{"moon", "00112233445566778899aabbccddeeff", "rover1"};
  const std::filesystem::path socket_ = run_ / "moon-00112233" / "rover1.sock";
};

TEST_F(EndpointTest, FindsTheSocketInTheRunFolder) {
  const Listener agent(socket_);
  EXPECT_EQ(FindEndpoint(agent_).value(), "ipc://" + socket_.string());
}

TEST_F(EndpointTest, FindsTheSocketThatTheDataFolderNames) {
  MakePrivate(folder_.path() / "elsewhere");
  const std::filesystem::path elsewhere = folder_.path() / "elsewhere" / "a.sock";
  const Listener agent(elsewhere);
  Report(elsewhere);
  EXPECT_EQ(FindEndpoint(agent_, data_).value(), "ipc://" + elsewhere.string());
  EXPECT_FALSE(FindEndpoint(agent_)) << "without the data folder";
}

TEST_F(EndpointTest, AnOutdatedDataFolderDoesNotHideTheRunFolder) {
  const Listener agent(socket_);
  Report(folder_.path() / "gone.sock");
  EXPECT_EQ(FindEndpoint(agent_, data_).value(), "ipc://" + socket_.string());
  std::ofstream(data_ / kEndpointFile) << "tcp://10.0.0.1:7400\n";
  EXPECT_EQ(FindEndpoint(agent_, data_).value(), "ipc://" + socket_.string());
}

TEST_F(EndpointTest, IgnoresASocketInAFolderThatOthersMayWrite) {
  const std::filesystem::path open = folder_.path() / "open";
  std::filesystem::create_directory(open);
  std::filesystem::permissions(open, std::filesystem::perms(0777));
  const Listener other(open / "a.sock");
  Report(open / "a.sock");
  EXPECT_FALSE(FindEndpoint(agent_, data_));
}

TEST_F(EndpointTest, SaysWhyNobodyAnswers) {
  const auto missing = FindEndpoint(agent_, data_);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(missing.error().text, HasSubstr("agent rover1 is not running (no socket "));
  { const Listener agent(socket_); }
  EXPECT_THAT(FindEndpoint(agent_).error().text, HasSubstr("no process listens at " + socket_.string()));
  std::filesystem::permissions(socket_.parent_path(), std::filesystem::perms(0755));
  EXPECT_EQ(FindEndpoint(agent_).error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace moondb
