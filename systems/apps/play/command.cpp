// SPDX-License-Identifier: Apache-2.0
#include "apps/play/command.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/error.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

constexpr Duration kGrace = std::chrono::seconds(2);

[[noreturn]] void become(const CommandOptions& options, char** argv, int error_fd) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  setpgid(0, 0);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  signal(SIGPIPE, SIG_DFL);
  for (const int fd : options.inherited) fcntl(fd, F_SETFD, 0);
  if (options.directory.empty() || chdir(options.directory.c_str()) == 0) execvp(argv[0], argv);
  const int error = errno;
  [[maybe_unused]] const auto written = write(error_fd, &error, sizeof error);
  _exit(127);
}

/// Says why a file that is there cannot be started: its interpreter is not there.
std::string about_interpreter(const CommandOptions& options) {
  std::ifstream script(fs::path(options.directory) / options.arguments.front());
  std::string line;
  if (!std::getline(script, line) || !line.starts_with("#!")) return "";
  const bool windows = line.ends_with('\r');
  if (windows) line.pop_back();
  return " (its first line asks for '" + line.substr(2, 80) + "'" +
         (windows ? ", and its lines end as on Windows: take the CR out)" : ")");
}

}  // namespace

Command::Command(const CommandOptions& options) {
  std::vector<char*> argv;
  for (const std::string& text : options.arguments) argv.push_back(const_cast<char*>(text.c_str()));
  argv.push_back(nullptr);
  for (const auto& [name, value] : options.environment) {
    setenv(name.c_str(), value.c_str(), /*overwrite=*/1);
  }
  int told[2];
  if (pipe2(told, O_CLOEXEC) != 0) throw environment_error("no pipe: " + error_text(errno));
  const FileDescriptor reads(told[0]);
  FileDescriptor writes(told[1]);
  pid_ = fork();
  if (pid_ == 0) become(options, argv.data(), writes.get());
  writes.reset();
  int error = pid_ < 0 ? errno : 0;
  if (pid_ > 0 && read(reads.get(), &error, sizeof error) == sizeof error) {
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  if (pid_ < 0) {
    throw bad_input("cannot start " + options.arguments.front() + ": " + error_text(error) +
                    (error == ENOENT ? about_interpreter(options) : "") +
                    "; correct runtime.command of the system");
  }
  watch_ = FileDescriptor(static_cast<int>(syscall(SYS_pidfd_open, pid_, 0)));
}

Command::~Command() {
  if (pid_ > 0 && !code_) {
    kill(-pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
}

std::optional<int> Command::wait(Duration patience) {
  if (code_) return code_;
  pollfd ended{.fd = watch_.get(), .events = POLLIN, .revents = 0};
  const int ms = static_cast<int>(to_ms(patience));
  if (poll(&ended, 1, ms) <= 0) return std::nullopt;
  int status = 0;
  // Kills the remaining process group before waitpid() frees the pid for reuse.
  kill(-pid_, SIGKILL);
  waitpid(pid_, &status, 0);
  code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  return code_;
}

int Command::end() {
  if (wait(Duration::zero())) return *code_;
  kill(-pid_, SIGTERM);
  if (wait(kGrace)) return *code_;
  kill(-pid_, SIGKILL);
  while (!wait(kGrace)) {
  }
  return *code_;
}

}  // namespace slambed
