#include <pliant/base/errors.h>
#include <pliant/base/options.h>
#include <pliant/base/petsc.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace pliant::test::options_test {
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Catch::Matchers::Message;
using Catch::Matchers::StartsWith;
using Arguments = std::vector<std::string>;

namespace {

enum class Kind { soft, rough, smooth };

// A program with one option of every type.
struct Program {
  Real width = 5, angle = 30, energy = -1;
  std::optional<Real> dt;
  Index n = 100;
  std::int64_t seed = 1;
  bool plot = false;
  std::string output = "run", integrator = "verlet";
  Kind model = Kind::soft;
  Options options;

  Program() {
    options.group("Hopper geometry");
    options.bind(
        "hopper_width", width,
        {.help = "orifice width w", .unit = "sigma_avg", .min = 0, .min_open = true, .on_restart = OnRestart::fixed});
    options.bind("hopper_angle", angle, {.help = "angle", .unit = "degrees", .min = 0, .max = 90, .max_open = true});
    options.group("Run");
    options.bind("energy", energy, {.help = "any real number"});
    options.bind("dt", dt, {.help = "time step", .unit = "t0", .min = 0, .automatic = "from the stiffness"});
    options.bind("n", n, {.help = "particles", .min = 1});
    options.bind("seed", seed, {.help = "seed", .min = 0});
    options.bind("plot", plot, {.help = "draw a | figure"});
    options.bind("output", output, {.help = "folder", .on_restart = OnRestart::forget});
    options.bind("integrator", integrator, {.help = "integrator", .choices = {"verlet", "ts"}});
    options.bind("model", model, {{"sp", Kind::soft}, {"rough", Kind::rough}, {"smooth", Kind::smooth}},
                 {.help = "particle model", .on_restart = OnRestart::fixed});
  }
  void parse(const Arguments& arguments) { REQUIRE(options.parse(arguments) == Options::Request::run); }
};

// The message of the InputError that the arguments cause.
std::string complaint(const Arguments& arguments) {
  Program program;
  try {
    program.options.parse(arguments);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "pliant-options-XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return (path_ / name).string();
  }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

std::string petsc_value(const char* name) {
  char text[200] = "";
  PetscBool found = PETSC_FALSE;
  petsc_check(PetscOptionsGetString(nullptr, nullptr, name, text, sizeof text, &found));
  return found != PETSC_FALSE ? text : "not set";
}

}  // namespace

TEST_CASE("without arguments the bound variables keep their defaults") {
  Program p;
  p.parse({});
  CHECK(p.width == 5);
  CHECK_FALSE(p.dt);
  CHECK(p.model == Kind::soft);
  CHECK_FALSE(p.options.given("hopper_width"));
}

TEST_CASE("arguments set variables of every type") {
  Program p;
  p.parse({"-hopper_width", "3.5", "--hopper_angle", "1e1", "-energy", "-.5", "-dt", "1e-3", "-n", "1e6", "-seed",
           "12345678901234", "-plot", "-output", "some folder", "-integrator", "ts", "-model", "smooth"});
  CHECK(p.width == 3.5);
  CHECK(p.angle == 10);
  CHECK(p.energy == -0.5);
  CHECK(p.dt == 1e-3);
  CHECK(p.n == 1000000);
  CHECK(p.seed == 12345678901234);
  CHECK(p.plot);
  CHECK(p.output == "some folder");
  CHECK(p.integrator == "ts");
  CHECK(p.model == Kind::smooth);
  CHECK(p.options.source("dt") == "command line");

  p.parse({"-hopper_width", "1", "-hopper_width", "2"});
  CHECK(p.width == 2);  // the last wins
  CHECK(p.n == 100);    // and nothing is left of the parse before
  CHECK_FALSE(p.dt);
}

TEST_CASE("real numbers are finite and written as numbers") {
  const auto [text, value] = GENERATE(
      table<const char*, Real>({{"1e3", 1000}, {".5", 0.5}, {"-2", -2}, {"+4.", 4}, {"-1e-3", -1e-3}, {"0", 0}}));
  Program p;
  p.parse({"-energy", text});
  CHECK(p.energy == value);
  for (const char* bad :
       {"nan", "-nan", "inf", "-inf", "-Infinity", "", " ", "5x", "1,5", "0x10", "1e", "--", "+-2", "1 2"})
    CHECK_THAT(complaint({"-energy", bad}), StartsWith(fmt::format("-energy {}: not a finite number", bad)));
  CHECK_THAT(complaint({"-energy", "1e400"}), Contains("too large"));
  CHECK(complaint({"-energy"}) == "-energy: needs a value (real)");
  CHECK(complaint({"-energy", "-plot"}) == "-energy: needs a value (real)");
}

TEST_CASE("integers are integral and fit") {
  Program p;
  p.parse({"-n", "2147483647", "-seed", "9223372036854775807"});
  CHECK(p.n == 2147483647);
  CHECK(p.seed == 9223372036854775807);
  p.parse({"-n", "1.5e1"});
  CHECK(p.n == 15);
  CHECK_THAT(complaint({"-n", "2147483648"}), Contains("is out of range") && Contains("2147483647"));
  CHECK_THAT(complaint({"-n", "1e10"}), Contains("is out of range"));
  CHECK_THAT(complaint({"-seed", "9223372036854775808"}), Contains("is out of range"));
  CHECK_THAT(complaint({"-seed", "1e300"}), Contains("is out of range"));
  CHECK(complaint({"-n", "2.5"}) == "-n 2.5: not an integer");
  CHECK(complaint({"-n", "ten"}) == "-n ten: not an integer");
  CHECK(complaint({"-n", ""}) == "-n : not an integer");
  CHECK(complaint({"-n", "nan"}) == "-n nan: not an integer");
  CHECK(complaint({"-n", "0"}) == "-n 0: must be at least 1");
}

TEST_CASE("texts are not empty, and plain") {
  CHECK(complaint({"-output", ""}) == "-output : is empty");
  CHECK(complaint({"-output", "caf\xc3\xa9"}) == "no error");
  for (const char* bad :
       {"caf\xe9", "a\nb", "\x7f", "\xc0\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xc2\x85", "\xe2\x82"})
    CHECK_THAT(complaint({"-output", bad}), Contains("is not plain text"));
  CHECK(complaint({"-output", "a\x1b[31m"}) ==
        "-output a\\x1b[31m: is not plain text; it must be UTF-8 without control characters");
  CHECK_THAT(complaint({"-output", std::string(4097, 'x')}), Contains("(4097 bytes): is too long"));
  CHECK_THAT(complaint({"-" + std::string(200, 'x')}), StartsWith("unknown option -xxx"));
  CHECK_THAT(complaint({"-energy", std::string(5000, '1')}), Contains("is too long"));
}

TEST_CASE("yes and no are understood in their usual spellings") {
  Program p;
  for (const char* yes : {"true", "yes", "on", "1", "True", "YES"}) {
    p.parse({"-plot", yes});
    CHECK(p.plot);
  }
  for (const char* no : {"false", "no", "off", "0", "False"}) {
    p.parse({"-plot", "-plot", no});
    CHECK_FALSE(p.plot);
  }
  CHECK_THAT(complaint({"-plot", "maybe"}), StartsWith("-plot maybe: not a yes or no"));
}

TEST_CASE("values out of range are refused with the range and the unit") {
  CHECK(complaint({"-hopper_width", "-3"}) == "-hopper_width -3: must be greater than 0 (unit sigma_avg)");
  CHECK(complaint({"-hopper_width", "0"}) == "-hopper_width 0: must be greater than 0 (unit sigma_avg)");
  CHECK(complaint({"-hopper_angle", "90"}) == "-hopper_angle 90: must be at least 0 and less than 90 (unit degrees)");
  CHECK(complaint({"-hopper_angle", "0"}) == "no error");
  CHECK(complaint({"-dt", "-1"}) == "-dt -1: must be at least 0 (unit t0)");
  CHECK(complaint({"-model", "ruogh"}) == "-model ruogh: must be one of sp, rough, smooth; did you mean rough?");
  CHECK(complaint({"-model", "cube"}) == "-model cube: must be one of sp, rough, smooth");
  CHECK(complaint({"-integrator", "Verlet"}) == "-integrator Verlet: must be one of verlet, ts; did you mean verlet?");
}

TEST_CASE("unknown options are refused with the nearest name") {
  CHECK(complaint({"-hoper_width", "3"}) == "unknown option -hoper_width; did you mean -hopper_width?");
  CHECK(complaint({"-Hopper_width", "3"}) == "unknown option -Hopper_width; did you mean -hopper_width?");
  CHECK(complaint({"-temperature", "3"}) == "unknown option -temperature; -help lists all options");
  CHECK(complaint({"-w", "3"}) == "unknown option -w; did you mean -hopper_width?");  // as its help has it
  CHECK(complaint({"-z"}) == "unknown option -z; -help lists all options");
  CHECK(complaint({"-hopper_width=3"}) == "unknown option -hopper_width=3; write -hopper_width 3");
  CHECK(complaint({"-TS_type", "rk"}) == "unknown option -TS_type; did you mean -ts_type?");
  CHECK_THAT(complaint({"-malloc_debug"}), StartsWith("unknown option -malloc_debug"));  // PETSc would read it too late
  CHECK(complaint({"5"}) == "unexpected argument '5' (command line); options are written -name value");
  CHECK_THAT(complaint({"-n", "5", "6"}), StartsWith("unexpected argument '6' (command line)"));
}

TEST_CASE("-help and -version come before everything else") {
  Program p;
  CHECK(p.options.parse({"-hopper_width", "nan", "-help"}) == Options::Request::help);
  CHECK(p.options.parse({"--help"}) == Options::Request::help);
  CHECK(p.options.parse({"-h"}) == Options::Request::help);
  CHECK(p.options.parse({"-version", "-unknown"}) == Options::Request::version);
  CHECK(p.options.parse({"-version", "-help"}) == Options::Request::help);
  CHECK(p.width == 5);
  const Folder folder;
  CHECK_THAT(complaint({"-options_file", folder.write("a.yaml", "help: yes\n")}),
             Contains("belongs on the command line"));
}

TEST_CASE("options files in YAML and in text set options, and the command line wins") {
  const Folder folder;
  const std::string yaml = folder.write("a.yaml",
                                        "# a comment\n"
                                        "hopper:\n"
                                        "  width: 3.5   # comment\n"
                                        "  angle: 20\n"
                                        "n: 7\n"
                                        "plot: yes\n"
                                        "output: \"with blanks\"\n"
                                        "energy: -1e2\n"
                                        "ts: {type: rk, rk: {type: 5dp}}\n"
                                        "ts_monitor:\n");
  const std::string text = folder.write("b.txt", "# comment\n-n 8 # more\n-output 'more blanks'\n-plot -energy -2\n");
  Program p;
  p.parse({"-options_file", yaml, "-hopper_angle", "10"});
  CHECK(p.width == 3.5);
  CHECK(p.angle == 10);
  CHECK(p.n == 7);
  CHECK(p.plot);
  CHECK(p.output == "with blanks");
  CHECK(p.energy == -100);
  CHECK(petsc_value("-ts_type") == "rk");
  CHECK(petsc_value("-ts_rk_type") == "5dp");
  CHECK(petsc_value("-ts_monitor") == "");
  CHECK(p.options.source("n") == yaml);
  CHECK(p.options.source("hopper_angle") == "command line");

  p.parse({"-n", "9", "-options_file", yaml, "-options_file", text});
  CHECK(p.n == 9);
  CHECK(p.output == "more blanks");  // the later file
  CHECK(p.energy == -2);
  CHECK(p.width == 3.5);
  CHECK(p.options.source("energy") == text);
}

TEST_CASE("YAML is read as PETSc's own reader reads it") {
  const Folder folder;
  const std::string file = folder.write("a.yaml",
                                        "ts: {type: rk, adapt: {type: basic, clip: [0.1, 10]}}\n"
                                        "---\n"
                                        "snes_rtol: 1e-8\nsnes:\n  monitor:\n  type: \"newton ls\"\nksp: {}\n"
                                        "pc: &a {type: lu}\nmat: *a\nsub_pc_type: ilu\nvec_view: 'a#b'\n");
  Program p;
  p.parse({"-options_file", file});
  PetscOptions reference = nullptr;
  petsc_check(PetscOptionsCreate(&reference));
  petsc_check(PetscOptionsInsertFileYAML(PETSC_COMM_SELF, reference, file.c_str(), PETSC_TRUE));
  char *ours = nullptr, *theirs = nullptr;
  petsc_check(PetscOptionsGetAll(nullptr, &ours));
  petsc_check(PetscOptionsGetAll(reference, &theirs));
  CHECK(std::string(ours) == theirs);
  CHECK_THAT(theirs, Contains("-ts_adapt_clip 0.1,10"));
  petsc_check(PetscFree(ours));
  petsc_check(PetscFree(theirs));
  petsc_check(PetscOptionsDestroy(&reference));
}

TEST_CASE("faults in options files name the file and the line") {
  const Folder folder;
  const auto from = [&](const std::string& name, const std::string& text) {
    const std::string file = folder.write(name, text);
    std::string message = complaint({"-options_file", file});
    if (const auto at = message.find(file); at != std::string::npos) message.replace(at, file.size(), name);
    return message;
  };
  CHECK(from("a.yaml", "n: 5\nhopper:\n  width: -3\n") ==
        "-hopper_width -3 (a.yaml:3): must be greater than 0 (unit sigma_avg)");
  CHECK(from("a.yaml", "hopper:\n  widht: 3\n") ==
        "unknown option -hopper_widht (a.yaml:2); did you mean -hopper_width?");
  for (const char* nothing : {"", " ~", " null", " Null", " NULL", " !!null ''", " {}", " # nothing"}) {
    INFO(nothing);
    for (const auto& [name, type] : {std::pair{"n", "integer"},
                                     {"plot", "yes|no"},
                                     {"energy", "real"},
                                     {"dt", "real"},
                                     {"output", "text"},
                                     {"integrator", "verlet|ts"},
                                     {"model", "sp|rough|smooth"}})
      CHECK(from("a.yaml", fmt::format("{}:{}\n", name, nothing)) ==
            fmt::format("-{} (a.yaml:1): needs a value ({})", name, type));
    CHECK(from("a.yaml", fmt::format("hopper:\n  width:{}\n", nothing)) ==
          "-hopper_width (a.yaml:2): needs a value (real)");
  }
  CHECK_THAT(from("a.yaml", "ts_adapt_clip: [1, ~]\n"), Contains("an item of a list has no value"));
  CHECK(from("a.txt", "-n\n-energy 2\n") == "-n (a.txt:1): needs a value (integer)");
  CHECK(from("a.yaml", "energy: .nan\n") == "-energy .nan (a.yaml:1): not a finite number");
  CHECK(from("a.yaml", "energy: [1, 2]\n") == "-energy 1,2 (a.yaml:1): not a finite number");
  CHECK(from("a.yaml", "n: 5\nn: 6\n") == "options file a.yaml:2: n is given twice, first in line 1");
  CHECK(from("a.yaml", "hopper_width: 5\nhopper: {width: 5}\n") ==
        "options file a.yaml:2: hopper_width is given twice, first in line 1");
  CHECK_THAT(from("a.yaml", "n: 5\nenergy: [1, 2\n"), StartsWith("options file a.yaml:3: malformed YAML: "));
  CHECK_THAT(from("a.yaml", "hopper:\n\twidth: 5\n"),
             StartsWith("options file a.yaml:2: malformed") && Contains("tabs"));
  CHECK_THAT(from("a.yaml", "n: 5\nenergy: \xff\n"), StartsWith("options file a.yaml:2: malformed YAML"));
  CHECK(from("a.yaml", "just text\n") == "options file a.yaml:1: expected lines of the form `name: value`");
  CHECK(from("a.yaml", "- n\n- energy\n") == "options file a.yaml:1: expected lines of the form `name: value`");
  CHECK(from("a.yaml", "n: 5\n[1]: 2\n") == "options file a.yaml:2: a key must be a plain name");
  CHECK(from("a.yaml", "energy: [{a: 1}]\n") == "options file a.yaml:1: a list may hold plain values only");
  CHECK_THAT(from("a.yaml", "energy: &x [*x]\n"), Contains("plain values only"));
  CHECK_THAT(from("a.yaml", "hopper: &x {a: *x}\n"), Contains("nested deeper"));
  CHECK_THAT(from("a.yaml", "<<: {n: 5}\n"), Contains("not supported"));
  CHECK_THAT(from("a.yaml", std::string("n: 5\0n: 6\n", 10)), Contains("not a text file"));
  CHECK_THAT(from("a.yaml", "output: \"a\\0b\"\n"), Contains("zero byte"));
  CHECK_THAT(from("a.yaml", "options_file: b.yaml\n"), Contains("names another options file"));
  CHECK(from("a.txt", "-n 5\n\nenergy 3\n") ==
        "unexpected argument 'energy' (a.txt:3); options are written -name value");
  CHECK(from("a.txt", "-n 5\n-n 6\n") == "options file a.txt:2: n is given twice, first in line 1");
  CHECK(from("a.txt", "-n 5\n-output 'x\n'") == "options file a.txt:2: a quote is not closed in its line");
  CHECK_THAT(from("a.txt", "n: 5\n"), Contains("unexpected argument"));
  CHECK(from("a.yaml", "\xef\xbb\xbfn: 5\r\nenergy: 1\r\n") == "no error");  // as Windows writes them
  CHECK(from("a.txt", "\xef\xbb\xbf-n 5\r\n-energy 1\r\n") == "no error");
  CHECK_THAT(from("a.yaml", "n: 5\n#" + std::string(1 << 16, 'x')), Contains("too large"));
  CHECK_THAT(from("a.yaml", "a: &a {x: 1}\nb: [" + std::string(2000, '[')), Contains("malformed"));
  CHECK(from("a.yml", "") == "no error");
  CHECK(from("a.yaml", "# nothing yet\n") == "no error");
  CHECK(from("a.txt", "") == "no error");

  CHECK_THAT(complaint({"-options_file", folder.path()}), Contains("is a folder"));
  CHECK_THAT(complaint({"-options_file", folder.path() + "/none.yaml"}),
             Contains("none.yaml: cannot be opened: No such file"));
  CHECK(complaint({"-options_file"}) == "-options_file: needs the name of a file");
  CHECK(complaint({"-options_file", "-n", "5"}) == "-options_file: needs the name of a file");
}

TEST_CASE("PETSc's options reach its objects, and one that nobody reads is an error") {
  Program p;
  p.parse({"-ts_type", "rk", "-ts_rtol", "1e-7", "-n", "5", "-options_left"});
  CHECK_THROWS_WITH(p.options.check_consumed(), StartsWith("option -ts_"));
  PetscTs ts;
  petsc_check(TSCreate(PETSC_COMM_SELF, ts.out()));
  petsc_check(TSSetFromOptions(ts));
  CHECK_NOTHROW(p.options.check_consumed());
  PetscBool is_rk = PETSC_FALSE;
  petsc_check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(ts.get()), TSRK, &is_rk));
  CHECK(is_rk == PETSC_TRUE);
  PetscReal rtol = 0;
  petsc_check(TSGetTolerances(ts, nullptr, nullptr, &rtol, nullptr));
  CHECK(rtol == 1e-7);

  p.parse({"-ts_rtoll", "1e-7", "-ts_type", "rk"});
  petsc_check(TSSetFromOptions(ts));
  CHECK_THROWS_MATCHES(p.options.check_consumed(), InputError,
                       Message("option -ts_rtoll 1e-7 has no effect; did you mean -ts_rtol?"));
  p.parse({"-ksp_rtol", "1e-7"});
  CHECK_THROWS_WITH(p.options.check_consumed(), Contains("-ksp_rtol 1e-7 has no effect") && !Contains("did you mean"));
  p.parse({});
  CHECK(petsc_value("-ksp_rtol") == "not set");
}

TEST_CASE("objects with an options prefix of their own are accepted when declared") {
  CHECK_THAT(complaint({"-relax_ts_type", "rk"}), StartsWith("unknown option -relax_ts_type"));
  Program p;
  p.options.accept_petsc_prefix("relax_");
  p.parse({"-relax_ts_type", "rk"});
  CHECK(petsc_value("-relax_ts_type") == "rk");
}

TEST_CASE("json tells value, unit and source, and gives a restart the same options") {
  const Folder folder;
  const std::string file = folder.write("a.yaml", "hopper_width: 0.1\n");
  Program p;
  p.parse({"-options_file", file, "-n", "1e3", "-model", "rough", "-ts_rtol", "1e-5", "-plot", "-output", "first"});
  const auto stored = nlohmann::json::parse(p.options.json().dump());  // through text, as in a file
  CHECK(stored["hopper_width"] ==
        nlohmann::json({{"value", 0.1}, {"unit", "sigma_avg"}, {"source", file}, {"is_default", false}}));
  CHECK(stored["n"] ==
        nlohmann::json({{"value", 1000}, {"unit", ""}, {"source", "command line"}, {"is_default", false}}));
  CHECK(stored["hopper_angle"]["source"] == "default");
  CHECK(stored["dt"]["value"].is_null());
  CHECK(stored["model"]["value"] == "rough");
  CHECK(stored["plot"]["value"] == true);
  CHECK(stored["ts_rtol"]["value"] == "1e-5");

  SECTION("the stored values stand where the user gives none") {
    Program q;
    q.parse({"-n", "5", "-dt", "0.01"});
    q.options.from_json(stored);
    CHECK(q.width == 0.1);
    CHECK(q.model == Kind::rough);
    CHECK(q.plot);
    CHECK(q.n == 5);
    CHECK(q.dt == 0.01);
    CHECK(q.output == "run");  // OnRestart::forget
    CHECK(petsc_value("-ts_rtol") == "1e-5");
    CHECK(q.options.source("hopper_width") == "restart");
    CHECK(q.options.source("n") == "command line");
  }
  SECTION("a fixed option may be repeated, not changed") {
    Program q;
    q.parse({"-hopper_width", "1e-1"});
    CHECK_NOTHROW(q.options.from_json(stored));
    q.parse({"-hopper_width", "0.2"});
    CHECK_THROWS_MATCHES(q.options.from_json(stored), RestartConflict,
                         Message("-hopper_width 0.2: the stored run has 0.1, and a restart cannot change it; leave it "
                                 "out, or start a new run in another folder"));
  }
  SECTION("what was stored is forgotten again") {
    Program q;
    q.parse({"-n", "5", "-ts_type", "rk"});
    const auto before = q.options.json();
    auto half = stored;
    half["zzz"] = 1;  // fails, after others have been set
    CHECK_THROWS_AS(q.options.from_json(half), InputError);
    CHECK(q.options.json() != before);
    q.options.reset();
    CHECK(q.options.json() == before);
    CHECK(q.n == 5);
    CHECK(q.width == Program().width);
    CHECK(petsc_value("-ts_rtol") == "not set");
    CHECK(petsc_value("-ts_type") == "rk");
  }
  SECTION("damaged or foreign stored options are refused") {
    Program q;
    q.parse({});
    CHECK_THROWS_AS(q.options.from_json(nlohmann::json::array()), InputError);
    CHECK_THROWS_AS(q.options.from_json({{"n", 5}}), InputError);
    CHECK_THROWS_AS(q.options.from_json({{"n", {{"value", nullptr}}}}), InputError);
    CHECK_THROWS_AS(q.options.from_json({{"n", {{"value", -5}}}}), InputError);
    CHECK_THROWS_WITH(q.options.from_json({{"old_name", {{"value", 1}}}}), Contains("-old_name is unknown"));
  }
}

TEST_CASE("help and the reference show group, type, default, unit, range and choices") {
  const Program p;
  const std::string help = p.options.help();
  CHECK_THAT(help,
             StartsWith("Groups, shown alone by -help GROUP: Hopper geometry, Run\n\nHopper geometry:\n") &&
                 Contains("\n  -hopper_width <real>                orifice width w [sigma_avg; default 5; > 0]\n") &&
                 Contains("[degrees; default 30; ≥ 0, < 90]\n") && Contains("\nRun:\n") &&
                 Contains("-model <sp|rough|smooth>") && Contains("default sp]\n") &&
                 Contains("[t0; default from the stiffness; ≥ 0]\n") && Contains("-options_file"));
  const std::string reference = p.options.markdown();
  CHECK_THAT(
      reference,
      StartsWith("## Hopper geometry\n\n| option | type | default | unit | range | on restart | meaning |\n|---") &&
          Contains("| `-hopper_width` | real | 5 | sigma_avg | > 0 | fixed | orifice width w |\n") &&
          Contains("| `-plot` | yes\\|no | no |  |  | may change | draw a \\| figure |\n"));
}

TEST_CASE("help begins with the options that are used most, and shows one group alone") {
  Program p;
  p.options.most_used({"model", "hopper_width"});
  CHECK_THAT(p.options.help(), StartsWith("Most used:\n  -model <sp|rough|smooth> ") && Contains("\n\nGroups, shown"));
  CHECK_THROWS_AS(p.options.most_used({"width"}), std::logic_error);
  REQUIRE(p.options.parse({"-help", "hopper"}) == Options::Request::help);
  CHECK(p.options.help_group() == "hopper");
  const std::string alone = p.options.help("hopper"), run = p.options.help("RUN");
  CHECK_THAT(alone, StartsWith("Hopper geometry:\n  -hopper_width <real> "));
  CHECK(alone.find("-model") == std::string::npos);
  CHECK_THAT(run, StartsWith("Run:\n") && Contains("-model"));
  CHECK(run.find("-hopper_width") == std::string::npos);
  CHECK_THROWS_WITH(p.options.help("walls"),
                    "-help walls: there is no such group; the groups are Hopper geometry, Run");
  CHECK(p.options.help().find("[H n]") == std::string::npos);
  Real k_b = 0.5;
  p.options.group("Bending");
  p.options.bind("k_b", k_b, {.help = "bending modulus [H 8]"});
  CHECK_THAT(p.options.help("bending"), Contains("bending modulus [H 8] [default 0.5]\n\n[H n] and [T n.m] are "));
  CHECK(p.options.help("hopper").find("[H n]") == std::string::npos);
  CHECK_THAT(p.options.help(), EndsWith("that docs/README.md names.\n"));
  REQUIRE(p.options.parse({"-help"}) == Options::Request::help);
  CHECK(p.options.help_group().empty());
}

TEST_CASE("names of units are explained") {
  Program p;
  p.options.explain_units({{"g", "g is the unit of acceleration: leave it out"}});
  CHECK_THROWS_MATCHES(p.options.parse({"-g", "9.81"}), InputError,
                       Message("unknown option -g; g is the unit of acceleration: leave it out"));
  CHECK_THROWS_MATCHES(p.options.parse({"-w", "3"}), InputError,
                       Message("unknown option -w; did you mean -hopper_width?"));
}

TEST_CASE("paths are relative to the file that names them") {
  const Folder folder;
  std::string shape, from = "not read";
  Options options;
  options.bind("shape", shape, {.help = "file", .read = [&](const std::string& file, const std::filesystem::path& in) {
                                  from = in.string();
                                  return path_from(in, file);
                                }});
  for (const char* name : {"a.yaml", "a.txt"}) {
    const std::string file =
        folder.write(name, std::string(name) == "a.yaml" ? "shape: s/o.txt\n" : "-shape s/o.txt\n");
    REQUIRE(options.parse({"-options_file", file}) == Options::Request::run);
    CHECK(from == folder.path());
    CHECK(shape == folder.path() + "/s/o.txt");
  }
  REQUIRE(options.parse({"-shape", "o.txt"}) == Options::Request::run);
  CHECK(from.empty());
  CHECK(shape == "o.txt");
  REQUIRE(options.parse({"-options_file", folder.write("b.yaml", "shape: /o.txt\n")}) == Options::Request::run);
  CHECK(shape == "/o.txt");
}

TEST_CASE("mistakes in declarations are the programmer's") {
  Program p;
  Real a = -1;
  CHECK_THROWS_AS(p.options.bind("n", a, {}), std::logic_error);
  CHECK_THROWS_AS(p.options.bind("help", a, {}), std::logic_error);
  CHECK_THROWS_AS(p.options.bind("a", a, {.min = 0}), std::logic_error);
  std::string text = "c";
  CHECK_THROWS_AS(p.options.bind("text", text, {.choices = {"a", "b"}}), std::logic_error);
  Kind kind = Kind::smooth;
  CHECK_THROWS_AS(p.options.bind("kind", kind, {{"sp", Kind::soft}}, {}), std::logic_error);
  CHECK_THROWS_AS(p.options.source("nothing"), std::logic_error);
}

TEST_CASE("an option keeps what is read in place of its text, for restarts too") {
  std::string shape;
  std::string content = "1 2\n3 4\n";
  const auto bind = [&](Options& options) {
    options.bind("shape", shape,
                 {.help = "file",
                  .on_restart = OnRestart::fixed,
                  .read = [&](const std::string& file, const std::filesystem::path&) {
                    if (content.empty()) throw InputError("cannot read {}", file);
                    return content;
                  }});
  };
  Options first;
  bind(first);
  REQUIRE(first.parse({}) == Options::Request::run);
  CHECK(shape.empty());  // nothing is read
  const nlohmann::json without = first.json();
  REQUIRE(first.parse({"-shape", "a.txt"}) == Options::Request::run);
  CHECK(shape == content);
  const nlohmann::json with = first.json();
  CHECK(with["shape"]["value"] == content);

  Options again;
  bind(again);
  REQUIRE(again.parse({}) == Options::Request::run);
  again.from_json(without);
  CHECK(shape.empty());
  again.reset();
  REQUIRE(again.parse({"-shape", "b.txt"}) == Options::Request::run);
  again.from_json(with);  // the same content
  CHECK(shape == "1 2\n3 4\n");
  content = "5 6\n";
  REQUIRE(again.parse({"-shape", "a.txt"}) == Options::Request::run);
  CHECK_THROWS_MATCHES(
      again.from_json(with), RestartConflict,
      Message("-shape 5 6\\x0a: the stored run has 1 2\\x0a3 4\\x0a, and a restart cannot change it; leave it "
              "out, or start a new run in another folder"));
  content.clear();
  REQUIRE(again.parse({}) == Options::Request::run);
  again.from_json(with);  // without the file
  CHECK(shape == "1 2\n3 4\n");
  CHECK_THROWS_WITH(again.parse({"-shape", "gone.txt"}), Contains("gone.txt"));
}

}  // namespace pliant::test::options_test
