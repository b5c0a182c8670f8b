#include <fmt/core.h>

#include <chrono>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/merger.h"
#include "bench/measure.h"
#include "bench/merge_world.h"
#include "bench/naive_merger.h"
using namespace moondb;
double Ms(BenchClock::duration d) { return std::chrono::duration<double, std::milli>(d).count(); }
int main(int argc, char** argv) {
  std::size_t n = argc > 1 ? std::stoul(argv[1]) : 100;
  int threads = argc > 2 ? std::stoi(argv[2]) : 1;
  bool naive_too = argc <= 3;
  MergeWorld w = MakeMergeWorld(n, 2000, 1);
  std::vector<PlacedMap> maps;
  std::vector<Footprint> fps;
  auto t0 = BenchClock::now();
  for (auto& m : w.maps) maps.push_back({*MakeLocalMap(m.key, m.stamp_ns, m.map, w.grid), m.map_from_node});
  fmt::print("local maps {:.3f} ms each\n", Ms(BenchClock::now() - t0) / n);
  for (std::size_t i = 0; i < w.footprints.size(); ++i) fps.push_back({{1, i}, w.footprints[i]});
  double naive = 0;
  if (naive_too) {
    NaiveMerger nm(maps, fps, w.grid);
    t0 = BenchClock::now();
    nm.Merge();
    naive = Ms(BenchClock::now() - t0);
    fmt::print("naive {:.1f} ms, {:.2f} a map; extent {} x {}\n", naive, naive / n, nm.extent().width(),
               nm.extent().height());
  }
  for (auto* k : AvailableKernels()) {
    if (argc > 4 && std::string(k->name) != argv[4]) continue;
    int reps = argc > 4 ? 60 : 7;
    auto be = std::make_shared<CpuGather>(CpuGather::Options{threads, k});
    Merger merger(w.grid, be);
    std::vector<double> times, put;
    for (int rep = 0; rep < reps; ++rep) {
      double shift = rep % 2 ? 1e-9 : 0;
      t0 = BenchClock::now();
      for (auto m : maps) {
        m.map_from_node.position_m.x() += shift;
        (void)merger.Put(m);
      }
      for (auto f : fps) {
        f.map_from_node.position_m.x() += shift;
        (void)merger.PutFootprint(f);
      }
      auto t1 = BenchClock::now();
      auto s = merger.Merge({});
      auto t2 = BenchClock::now();
      put.push_back(Ms(t1 - t0));
      times.push_back(Ms(t2 - t0));
      if (rep == 0) fmt::print("tiles {} ", s->gathered_tiles);
    }
    std::vector<double> inc, wd;
    for (int rep = 0; rep < reps; ++rep) {
      merger.Withdraw(maps[n - 1].map->key);
      t0 = BenchClock::now();
      (void)merger.Merge({});
      wd.push_back(Ms(BenchClock::now() - t0));
      t0 = BenchClock::now();
      (void)merger.Put(maps[n - 1]);
      auto s = merger.Merge({});
      inc.push_back(Ms(BenchClock::now() - t0));
      if (rep == 0) fmt::print("inc tiles {} full {}", s->gathered_tiles, s->is_full);
    }
    double full = Median(times);
    fmt::print("{}: put {:.2f} full {:.2f} ms ({:.0f}x), one more {:.3f} ms ({:.0f}x), withdraw {:.3f}\n",
               be->description(), Median(put), full, naive / full, Median(inc), naive / Median(inc), Median(wd));
  }
}
