// FakeAgent: stands in for an agent in tests of clients. It listens with a ROUTER on an ipc socket in a temporary
// folder. A thread sends the answers that the test specifies.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "proto/control.pb.h"
#include "tests/temporary_folder.h"

namespace moondb {

class FakeAgent {
 public:
  // Returns the frames with which to answer a request. Empty: no answer.
  using Answer = std::function<std::vector<std::string>(const proto::ClientMessage& request)>;

  explicit FakeAgent(Answer answer) : answer_(std::move(answer)) {
    router_.set(zmq::sockopt::linger, 0);
    router_.bind(endpoint());
    thread_ = std::thread([this] { Run(); });
  }
  ~FakeAgent() { Stop(); }

  std::string endpoint() const { return "ipc://" + temporary_.File("agent"); }
  int requests() const { return requests_; }

  // Ends the thread and closes the socket.
  void Stop() {
    is_stopping_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  void Run() {
    while (!is_stopping_) {
      zmq::pollitem_t item{router_.handle(), 0, ZMQ_POLLIN, 0};
      if (zmq::poll(&item, 1, std::chrono::milliseconds(10)) <= 0) continue;
      zmq::message_t client, frame;
      (void)router_.recv(client);
      (void)router_.recv(frame);
      ++requests_;
      proto::ClientMessage request;
      if (!request.ParseFromArray(frame.data(), static_cast<int>(frame.size()))) continue;
      for (const std::string& answer : answer_(request)) {
        router_.send(zmq::buffer(client.to_string()), zmq::send_flags::sndmore);
        router_.send(zmq::buffer(answer), zmq::send_flags::none);
      }
    }
    router_.close();
  }

  Answer answer_;
  const TemporaryFolder temporary_;
  zmq::context_t context_;
  zmq::socket_t router_{context_, zmq::socket_type::router};
  std::atomic<bool> is_stopping_ = false;
  std::atomic<int> requests_ = 0;
  std::thread thread_;
};

}  // namespace moondb
