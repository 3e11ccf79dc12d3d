#include "worldmodel/train/training_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/train/prepared_world.h"

/// A training that is carried to another machine.
namespace evac::train {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::string BytesOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TrainingJob JobOf(const Prepared& at) {
  TrainingJob job;
  job.config = at.config;
  job.world = Quick(3);
  job.world.job.trainer.learning_rate = 1.0 / 3000;
  job.world.view_weights = "1";
  job.start.codec_sha256 = "codec";
  job.start.init_except = {"model.diffusion_model.out."};
  job.init_sha256 = "5678";
  job.forecast_sha256 = "9abc";
  job.recipe = "def0,def0";
  job.begun_with = " page 1234 init 5678";
  return job;
}

TEST(TrainingJob, IsTheSameWhenReadAgain) {
  const Prepared at(1);
  const TrainingJob job = JobOf(at);
  WriteTrainingJob(at.folder / "job", job);
  const TrainingJob again = ReadTrainingJob(at.folder / "job");
  EXPECT_EQ(TextOf(again), TextOf(job));
  EXPECT_EQ(again.world.job.trainer.learning_rate, 1.0 / 3000) << "to the last digit";
  EXPECT_EQ(again.begun_with, job.begun_with);
  EXPECT_EQ(again.start.init_except, job.start.init_except);
  EXPECT_EQ(again.init_sha256, "5678");
  EXPECT_EQ(again.forecast_sha256, "9abc");
  EXPECT_EQ(again.recipe, "def0,def0");
  TrainingJob codec;
  codec.kind = TrainingKind::kCodec;
  codec.config = at.config;
  codec.codec.codec.latent_noise = 0.1;
  codec.wants_init = true;
  const TrainingJob codec_again = ParseTrainingJob(TextOf(codec), "job");
  EXPECT_EQ(codec_again.codec.codec.latent_noise, 0.1);
  EXPECT_TRUE(codec_again.wants_init);
}

TEST(TrainingJob, TrainsTheSameWeights) {
  const Prepared at(1);
  TrainingJob job = JobOf(at);
  job.start.init_except.clear();
  WorldOptions options = job.world;
  WorldStart start = job.start;
  start.codec = at.codec();
  TrainWorld({{at.folder / "shards"}, at.folder / "here", at.config}, options, start, {});

  TrainingJob there = ParseTrainingJob(TextOf(job), "job");
  there.start.codec = at.codec();
  TrainWorld({{at.folder / "shards"}, at.folder / "there", there.config}, there.world, there.start, {});
  const std::string bytes = BytesOf(at.folder / "here" / "weights.safetensors");
  ASSERT_FALSE(bytes.empty());
  EXPECT_EQ(BytesOf(at.folder / "there" / "weights.safetensors"), bytes);
}

/// Whatever lay there was gone: a page, or weights.
TEST(TrainingJob, DoesNotReplaceAFileThatIsNoJob) {
  const Prepared at(1);
  const TrainingJob job = JobOf(at);
  const std::filesystem::path path = at.folder / "there";
  for (const std::string text : {"", "evac", "evac-training 10\n", "world:\n  batch: 8\n", "evac-training 1"}) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
    EXPECT_THAT([&] { WriteTrainingJob(path, job); },
                ThrowsMessage<TensorError>(AllOf(HasSubstr(path.string() + ": what is there does not begin with"),
                                                 HasSubstr("wanted the name of a new file, or of an earlier job"))))
        << text;
    EXPECT_EQ(BytesOf(path), text);
  }
  std::ofstream(path, std::ios::binary | std::ios::trunc) << "evac-training 1\nof an earlier version\n";
  WriteTrainingJob(path, job);
  EXPECT_EQ(BytesOf(path), TextOf(job));
  EXPECT_THROW(WriteTrainingJob(at.folder / "shards", job), TensorError) << "a folder";
  EXPECT_FALSE(std::filesystem::exists(at.folder / "shards.tmp"));
}

/// It trained with the defaults of what was missing.
TEST(TrainingJob, CutOffOnItsWayItIsRefusedWhereverThatWas) {
  const std::string whole = TextOf(JobOf(Prepared(1))), first = "evac-training 1\nworld\n";
  ASSERT_TRUE(whole.starts_with(first));
  const std::size_t last_line = whole.rfind('\n', whole.size() - 2) + 1;
  for (std::size_t size = first.size(); size < whole.size(); ++size)
    EXPECT_THAT([&] { ParseTrainingJob(whole.substr(0, size), "job"); },
                ThrowsMessage<TensorError>(HasSubstr("job: it is cut off: wanted 'begun_with …' as its last line")))
        << size << " of " << whole.size() << ", the last line from " << last_line;
  for (std::size_t size = 0; size < first.size(); ++size)
    EXPECT_THROW(ParseTrainingJob(whole.substr(0, size), "job"), TensorError) << size;
  EXPECT_NO_THROW(ParseTrainingJob(whole, "job"));
}

/// What wrote them did not know which files and shards they were written for.
TEST(TrainingJob, OfAnEarlierVersionItIsReadAsBefore) {
  TrainingJob job = JobOf(Prepared(1));
  job.init_sha256 = job.forecast_sha256 = job.recipe = "";
  const std::string text = TextOf(job);
  EXPECT_EQ(text.find("init_sha256"), std::string::npos);
  EXPECT_EQ(text.find("recipe"), std::string::npos);
  EXPECT_EQ(TextOf(ParseTrainingJob(text, "job")), text);
}

TEST(TrainingJob, WhatIsWrongIsNamedWithItsLine) {
  const std::string good = TextOf(JobOf(Prepared(1)));
  const auto parse = [](const std::string& text) { return [text] { ParseTrainingJob(text, "job"); }; };
  const auto replaced = [&](const std::string& old, const std::string& by) {
    std::string text = good;
    return text.replace(text.find(old), old.size(), by);
  };
  EXPECT_NO_THROW(parse(good)());
  EXPECT_THAT(parse(""), ThrowsMessage<TensorError>(HasSubstr("job: its first line is ''")));
  EXPECT_THAT(parse(replaced("\nworld\n", "\nwold\n")), ThrowsMessage<TensorError>(HasSubstr("job:2: found 'wold'")));
  EXPECT_THAT(parse(replaced("size chunk 3", "size chunk three")),
              ThrowsMessage<TensorError>(HasSubstr("job:3: found 'size chunk three'")));
  EXPECT_THAT(parse(replaced("option batch 4", "option batsch 4")),
              ThrowsMessage<TensorError>(HasSubstr("found 'option batsch 4'")));
  EXPECT_THAT(parse(replaced("option steps 3", "option steps -3")), ThrowsMessage<TensorError>(HasSubstr("steps -3")));
  EXPECT_THAT(parse(replaced("option steps 3", "option steps 1099511627776")),
              ThrowsMessage<TensorError>(HasSubstr("steps 1099511627776")));
  EXPECT_NO_THROW(parse(replaced("option steps 3", "option steps 1099511627775"))());
  EXPECT_NO_THROW(parse(replaced("option seed 0\n", "option seed 18446744073709551615\n"))()) << "any 64 bits";
  EXPECT_THAT(parse(replaced("size chunk 3", "size chunk 0")), ThrowsMessage<TensorError>(HasSubstr("job: chunk is 0")));
  EXPECT_THAT([] { ReadTrainingJob("/no/such/job"); },
              ThrowsMessage<TensorError>(AllOf(HasSubstr("/no/such/job: cannot be read: "), HasSubstr("No such file"))));
}

}  // namespace
}  // namespace evac::train
