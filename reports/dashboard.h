#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "reports/summary.h"

namespace evac {

struct DashboardOptions {
  std::vector<std::filesystem::path> runs = {};  ///< folders; one that cannot be read (yet) is listed with its reason
  std::string host = "127.0.0.1";  ///< the address to listen at; any but a loopback one is open to the network
  int port = 0;                    ///< 0: any that is free
  SummaryOptions summary = {};
  double look_every_s = 1;   ///< how often stores are looked at for news, in (0, 3600]
  std::string program = {};  ///< "evac 0.1.0"
};

/// Reports over several stores, served while runs go on: reads only, answers GET alone, and gives out nothing but its
/// pages and the videos and thumbnails that lie inside the runs' folders (dashboard_paths.h). Pages are counted anew
/// when a store has changed and somebody asks.
class Dashboard {
 public:
  /// Listens from here on. @throws InvalidInput if the address cannot be had, or is another program's, or an option
  /// is out of range.
  explicit Dashboard(DashboardOptions options);
  ~Dashboard();
  Dashboard(const Dashboard&) = delete;
  Dashboard& operator=(const Dashboard&) = delete;

  int port() const;
  /// "http://127.0.0.1:41234/".
  std::string url() const;
  /// Answers until Stop, which any thread may call. @throws InternalError if it can be listened no more before that.
  void Serve();
  void Stop();

 private:
  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace evac
