#include "worldmodel/nn/memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <cstring>
#include <memory>

namespace evac::nn {
namespace {

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

long FaultsOfUsing(std::size_t bytes) {
  struct rusage before{}, after{};
  ::getrusage(RUSAGE_SELF, &before);
  const std::unique_ptr<char[], void (*)(void*)> block(static_cast<char*>(std::malloc(bytes)), std::free);
  std::memset(block.get(), 1, bytes);
  ::getrusage(RUSAGE_SELF, &after);
  return after.ru_minflt - before.ru_minflt;
}

TEST(KeepFreedMemory, TheSecondUseOfALargeBlockClearsNoPages) {
  constexpr std::size_t kBytes = 128 << 20;
  KeepFreedMemory();
  FaultsOfUsing(kBytes);
  EXPECT_LT(FaultsOfUsing(kBytes), 100);  // of 32768 pages, if the block had gone back to the kernel
}

#endif

}  // namespace
}  // namespace evac::nn
