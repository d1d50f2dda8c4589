// Steps the two motors of a robot that `rtds serve burger --socket motors.sock` serves.
//
//   g++ -O2 serve_client.cpp -o serve_client && ./serve_client motors.sock > log.bin
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstring>

enum Kind : uint32_t { HELLO = 1, EXCHANGE = 4, SAMPLES = 5, CLOSE = 6 };
struct Frame { uint32_t kind, length; };
struct Exchange { Frame head; float v[2], load[2]; uint32_t steps, every; };

static bool get(int fd, void *to, size_t count) {
  for (char *at = static_cast<char *>(to); count > 0;) {
    const ssize_t got = read(fd, at, count);
    if (got <= 0) return false;
    at += got, count -= got;
  }
  return true;
}

int main(int, char **arguments) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, arguments[1], sizeof address.sun_path - 1);
  const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
  if (connect(fd, reinterpret_cast<sockaddr *>(&address), sizeof address) != 0) return 1;
  Frame head;
  char hello[12];  // version, length of a step
  if (!get(fd, &head, sizeof head) || head.kind != HELLO || !get(fd, hello, sizeof hello)) return 1;
  float samples[32][4] = {};
  for (int exchange = 0; exchange < 50; exchange++) {
    const Exchange request = {{EXCHANGE, 24}, {0.2f * exchange, 6.0f - 0.25f * exchange},
                              {1e-6f * samples[31][1], 1e-6f * samples[31][3]}, 3200, 100};
    if (write(fd, &request, sizeof request) != sizeof request) return 1;
    if (!get(fd, &head, sizeof head) || head.kind != SAMPLES || !get(fd, samples, sizeof samples)) return 1;
    std::fwrite(samples, sizeof samples, 1, stdout);  // i_l, w_l, i_r, w_r each millisecond
  }
  const Frame close_it = {CLOSE, 0};
  return write(fd, &close_it, sizeof close_it) == sizeof close_it && close(fd) == 0 ? 0 : 1;
}
