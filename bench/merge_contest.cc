#include "bench/merge_contest.h"

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/gl_gather.h"
#include "actors/merge/merger.h"
#include "bench/gl_painter.h"
#include "bench/measure.h"
#include "bench/merge_world.h"
#include "bench/naive_merger.h"
#include "bench/opencv_merger.h"
#include "model/check.h"

namespace moondb {
namespace {

// Distance by which the maps move between two merges, so that the merger must place all maps again. The distance
// exceeds all rounding errors, but is far smaller than a cell.
constexpr double kNudge_m = 1e-7;

// Minimum fraction of cells that must agree. Rounding causes smaller differences; a wrong order of layers or a
// displaced layer causes much larger ones.
constexpr double kAgreesAtLeast = 0.999;

// Returns the fraction of equal cells, among the cells that are known in at least one of the grids.
double ShareOfSame(const std::vector<Cell>& a, const std::vector<Cell>& b) {
  Check(a.size() == b.size(), "two grids of one extent");
  std::size_t known = 0;
  std::size_t same = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] == Cell::kUnknown && b[i] == Cell::kUnknown) continue;
    ++known;
    same += a[i] == b[i] ? 1 : 0;
  }
  return known == 0 ? 1 : static_cast<double>(same) / static_cast<double>(known);
}

double Milliseconds(BenchClock::duration took) { return std::chrono::duration<double, std::milli>(took).count(); }

double NowMs() { return Milliseconds(BenchClock::now().time_since_epoch()); }

double Timed(const std::function<void()>& work) {
  const BenchClock::time_point start = BenchClock::now();
  work();
  return Milliseconds(BenchClock::now() - start);
}

class MergeContest {
 public:
  explicit MergeContest(const MergeContestOptions& options) : options_(options) {
    MergeWorld world = MakeMergeWorld(options.maps, options.side_cells, /*seed=*/1);
    grid_ = world.grid;
    std::uint64_t cells = 0;
    run_.local_map_ms =
        Timed([&] {
          for (const MapAtPose& map : world.maps) {
            here_.push_back({*MakeLocalMap(map.key, map.timestamp_ns, map.map, grid_), map.map_from_node});
          }
        }) /
        static_cast<double>(options.maps);
    std::uint64_t bytes = 0;
    for (const PlacedMap& map : here_) {
      bytes += map.map->bytes();
      for (const LocalLayer& layer : map.map->layers) cells += static_cast<std::uint64_t>(layer.width * layer.height);
    }
    for (std::size_t i = 0; i < world.footprints.size(); ++i) {
      footprints_here_.push_back({{1, i}, world.footprints[i]});
    }
    there_ = here_;
    footprints_there_ = footprints_here_;
    for (PlacedMap& map : there_) map.map_from_node.position_m.x() += kNudge_m;
    for (Footprint& footprint : footprints_there_) footprint.map_from_node.position_m.x() += kNudge_m;
    map_bytes_ = static_cast<double>(bytes);
    map_bytes_at_two_bits_ = static_cast<double>(cells) / 4;
  }

  Result<MergeRun> Run() {
    run_.maps = options_.maps;
    run_.side_cells = options_.side_cells;
    AddCpus();
    AddGl();
    naive_ = std::make_unique<NaiveMerger>(here_, footprints_here_, grid_);
    opencv_ = MakeOpencvMerger(here_, footprints_here_, grid_);
    for (int i = 0; i < options_.repetitions; ++i) {
      Note("naive", [this] { naive_->Merge(NaiveMerger::Arithmetic::kDouble); });
      Note("naive_integer", [this] { naive_->Merge(NaiveMerger::Arithmetic::kInteger); });
      if (opencv_ != nullptr) {
        Note("opencv", [this] { opencv_->Merge(naive_->extent()); });
      }
      if (painter_ != nullptr) {
        Note("painter", [this] { Keep(painter_->Merge(naive_->extent())); });
      }
      for (int k = 0; k < 3; ++k) RunMergers();
      if (!kept_) return tl::unexpected(kept_.error());
    }
    for (int i = 0; i < 3; ++i) {
      Note("read_cells", [this] { Keep(entrants_[0].merger->ReadCells(entrants_[0].merger->extent())); });
    }
    if (Result<void> agreed = CheckAgreement(); !agreed) return tl::unexpected(agreed.error());
    if (Result<void> compared = CompareOthers(); !compared) return tl::unexpected(compared.error());
    return Summary();
  }

 private:
  struct Entrant {
    std::string name;
    std::unique_ptr<Merger> merger;
    bool is_here = false;
  };

  // Stores the error of `result` in kept_, unless kept_ already has an error.
  template <typename T>
  void Keep(const Result<T>& result) {
    if (!result && kept_) kept_ = tl::unexpected(result.error());
  }

  void Merge(Merger& merger) { Keep(merger.Merge({})); }

  // Places all maps and footprints again and merges in full.
  void MergeFromScratch(Merger& merger, const std::vector<PlacedMap>& maps, const std::vector<Footprint>& footprints) {
    for (const PlacedMap& map : maps) Keep(merger.Put(map));
    for (const Footprint& footprint : footprints) Keep(merger.PutFootprint(footprint));
    Merge(merger);
  }

  void Note(const std::string& name, const std::function<void()>& work) { samples_[name].push_back(Timed(work)); }

  void Add(const std::string& name, std::shared_ptr<GatherBackend> backend) {
    entrants_.push_back({name, std::make_unique<Merger>(grid_, std::move(backend))});
    Entrant& entrant = entrants_.back();
    Note(name + "_first", [&] { MergeFromScratch(*entrant.merger, there_, footprints_there_); });
  }

  void AddCpus() {
    Add("cpu", std::make_shared<CpuGather>(CpuGather::Options{options_.threads, nullptr}));
    run_.cpu_description = entrants_.back().merger->backend().description();
    for (const GatherKernel* kernel : AvailableKernels()) {
      Add(kernel->name, std::make_shared<CpuGather>(CpuGather::Options{1, kernel}));
    }
    one_thread_ = entrants_.back().name;
  }

  void AddGl() {
    Result<std::unique_ptr<GlGather>> gl = GlGather::Create({});
    if (!gl) return;
    Add("gl", std::move(*gl));
    run_.gl_description = entrants_.back().merger->backend().description();
    GlGather::Options timed;
    timed.now_ms = NowMs;
    Result<std::unique_ptr<GlGather>> timed_gl = GlGather::Create(timed);
    Keep(timed_gl);
    if (!timed_gl) return;
    timed_gl_ = std::move(*timed_gl);
    timed_merger_ = std::make_unique<Merger>(grid_, timed_gl_);
    MergeFromScratch(*timed_merger_, there_, footprints_there_);
    run_.gl_maps_upload_ms = timed_gl_->times().upload_ms;
    if (Result<std::unique_ptr<GlPainter>> painter = GlPainter::Create(); painter) {
      painter_ = std::move(*painter);
      Keep(painter_->Load(here_, footprints_here_, grid_));
    }
  }

  // Runs each merger once: a full merge, then removing one map, adding one map, and moving one map.
  void RunMergers() {
    for (Entrant& entrant : entrants_) {
      entrant.is_here = !entrant.is_here;
      const auto& maps = entrant.is_here ? here_ : there_;
      const auto& footprints = entrant.is_here ? footprints_here_ : footprints_there_;
      Merger& merger = *entrant.merger;
      Note(entrant.name, [&] { MergeFromScratch(merger, maps, footprints); });
      if (entrant.name == "cpu" || entrant.name == "scalar") continue;
      const PlacedMap& one = maps[maps.size() / 2];
      Note(entrant.name + "_withdraw", [&] {
        merger.Withdraw(one.map->key);
        Merge(merger);
      });
      Note(entrant.name + "_more", [&] {
        Keep(merger.Put(one));
        Merge(merger);
      });
      PlacedMap elsewhere = one;
      elsewhere.map_from_node.position_m.x() += 0.3;
      Note(entrant.name + "_move", [&] {
        Keep(merger.Put(elsewhere));
        Merge(merger);
      });
      Keep(merger.Put(one));
      Merge(merger);
    }
    if (timed_merger_ == nullptr) return;
    is_timed_here_ = !is_timed_here_;
    MergeFromScratch(*timed_merger_, is_timed_here_ ? here_ : there_,
                     is_timed_here_ ? footprints_here_ : footprints_there_);
    samples_["gl_upload"].push_back(timed_gl_->times().upload_ms);
    samples_["gl_draw"].push_back(timed_gl_->times().draw_ms);
    samples_["gl_read"].push_back(timed_gl_->times().read_ms);
  }

  Result<void> CheckAgreement() {
    for (Entrant& entrant : entrants_) {
      MergeFromScratch(*entrant.merger, there_, footprints_there_);
      MergeFromScratch(*entrant.merger, here_, footprints_here_);
      const Result<MergeResult> merged = entrant.merger->Read(entrant.merger->extent());
      if (!merged) return tl::unexpected(merged.error());
      if (merged->slots.size() != naive_->cells().size()) return Fail(ErrorCode::kInternal, entrant.name + ": extent");
      for (std::size_t i = 0; i < merged->slots.size(); ++i) {
        const NaiveMerger::CellState& state = naive_->cells()[i];
        const std::uint32_t slot = merged->slots[i];
        const bool is_same = state.value == merged->merged.grid.cells[i] && state.level == merged->levels[i] &&
                             (state.map == UINT32_MAX ? slot == kNoSlot
                                                      : slot != kNoSlot && merged->maps[slot].map->key ==
                                                                               naive_->maps()[state.map].map->key);
        if (!is_same)
          return Fail(ErrorCode::kInternal, entrant.name + " and naive differ in cell " + std::to_string(i));
      }
    }
    return {};
  }

  // Compares the mergers that place layers with floats or doubles with the naive merger's result with integers.
  Result<void> CompareOthers() {
    const std::vector<Cell> expected = NaiveValues();
    if (opencv_ != nullptr) run_.opencv_agrees = ShareOfSame(expected, opencv_->cells());
    if (painter_ != nullptr) run_.painter_agrees = ShareOfSame(expected, painter_->cells());
    naive_->Merge(NaiveMerger::Arithmetic::kDouble);
    run_.naive_agrees = ShareOfSame(expected, NaiveValues());
    const double least = std::min({run_.naive_agrees, run_.opencv_agrees.value_or(1), run_.painter_agrees.value_or(1)});
    if (least >= kAgreesAtLeast) return {};
    return Fail(ErrorCode::kInternal, "of the known cells only a share of " + std::to_string(least) + " agrees");
  }

  std::vector<Cell> NaiveValues() const {
    std::vector<Cell> values;
    for (const NaiveMerger::CellState& state : naive_->cells()) values.push_back(state.value);
    return values;
  }

  std::optional<double> MedianOf(const std::string& name) const {
    const auto found = samples_.find(name);
    return found == samples_.end() ? std::nullopt : std::optional(Median(found->second));
  }

  MergeRun Summary() {
    const Merger& cpu = *entrants_[0].merger;
    run_.extent_cells = static_cast<std::uint64_t>(cpu.extent().width() * cpu.extent().height());
    run_.naive_ms = *MedianOf("naive");
    run_.naive_integer_ms = *MedianOf("naive_integer");
    run_.opencv_ms = MedianOf("opencv");
    run_.painter_ms = MedianOf("painter");
    run_.gl_ms = MedianOf("gl");
    run_.cpu_ms = *MedianOf("cpu");
    run_.cpu_one_thread_ms = *MedianOf(one_thread_);
    run_.cpu_first_ms = *MedianOf("cpu_first");
    run_.cpu_avx512_ms = MedianOf("avx512");
    run_.cpu_avx2_ms = MedianOf("avx2");
    run_.cpu_sse2_ms = MedianOf("sse2");
    run_.cpu_scalar_ms = *MedianOf("scalar");
    run_.incremental_cpu_ms = MedianOf(one_thread_ + "_more").value_or(0);
    run_.incremental_gl_ms = MedianOf("gl_more");
    run_.withdraw_cpu_ms = MedianOf(one_thread_ + "_withdraw").value_or(0);
    run_.move_cpu_ms = MedianOf(one_thread_ + "_move").value_or(0);
    run_.gl_upload_ms = MedianOf("gl_upload");
    run_.gl_draw_ms = MedianOf("gl_draw");
    run_.gl_read_ms = MedianOf("gl_read");
    run_.read_cells_ms = *MedianOf("read_cells");
    const double placed_bytes = static_cast<double>(cpu.bytes() - cpu.page_bytes());
    run_.memory_ratio = (map_bytes_ + placed_bytes) / map_bytes_at_two_bits_;
    run_.pages_mb = static_cast<double>(cpu.page_bytes()) / 1e6;
    return run_;
  }

  const MergeContestOptions options_;
  Result<void> kept_;
  MergeGrid grid_;
  std::vector<PlacedMap> here_;
  std::vector<PlacedMap> there_;
  std::vector<Footprint> footprints_here_;
  std::vector<Footprint> footprints_there_;
  double map_bytes_ = 0;
  double map_bytes_at_two_bits_ = 0;
  MergeRun run_;
  std::vector<Entrant> entrants_;
  std::string one_thread_;
  std::unique_ptr<NaiveMerger> naive_;
  std::unique_ptr<OpencvMerger> opencv_;
  std::unique_ptr<GlPainter> painter_;
  std::shared_ptr<GlGather> timed_gl_;
  std::unique_ptr<Merger> timed_merger_;
  bool is_timed_here_ = false;
  std::map<std::string, std::vector<double>> samples_;
};

}  // namespace

Result<MergeRun> RunMergeContest(const MergeContestOptions& options) { return MergeContest(options).Run(); }

}  // namespace moondb
