#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace evac {

/// A request as it came over the wire.
struct SeenRequest {
  std::string method, path, body;
  std::map<std::string, std::string> headers;  ///< names in lower case
};

/// What the server does then: pieces of bytes, each after a pause; at the end it closes the connection.
struct ScriptedAnswer {
  struct Piece {
    double pause_s = 0;
    std::string bytes;
  };
  std::vector<Piece> pieces;
  bool resets = false;  ///< closes it the hard way: the client sees a reset
};

/// "HTTP/1.1 200 OK" with a body and its length. @param headers  whole lines, each with its \r\n
ScriptedAnswer Answer(int status, const std::string& body, const std::string& headers = "");

/// A real HTTP server on loopback that answers as a test says, byte by byte, so that it can be as bad as real ones are.
class ScriptedServer {
 public:
  using Script = std::function<ScriptedAnswer(const SeenRequest&)>;

  /// @param script  called from several threads.
  explicit ScriptedServer(Script script);
  ~ScriptedServer();

  std::string Url() const;  ///< "http://127.0.0.1:PORT"
  std::vector<SeenRequest> Seen() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evac
