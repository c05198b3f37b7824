use super::*;
use viola_geometry::taxonomy::ClassTable;

#[test]
fn the_built_in_manifest_is_whole() {
    let manifest = Manifest::built_in().unwrap();
    for name in [
        "deeplab-ade20k",
        "segformer-ade20k",
        "mask2former-coco",
        "fastdepth",
        "depth-anything-v2-small",
        "migan",
        "stable-diffusion-inpainting",
        "onnxruntime",
    ] {
        assert!(manifest.find(name).is_some(), "{name}");
    }
    let deeplab = manifest.find("deeplab-ade20k").unwrap();
    assert_eq!(deeplab.input.as_ref().unwrap().width.pixels(), Some(513));
    assert_eq!(deeplab.classes, Some(ClassTable::Ade20k));
}

const GOOD: &str = r#"
[[network]]
name = "mine"
task = "segmentation"
file = "mine/net.onnx"
licence = "CC0"
classes = "home"
input = { width = 64, height = "any" }
output = { kind = "logits" }
source = { kind = "export", how = "by hand" }
"#;

#[test]
fn refusals_name_the_field() {
    assert_eq!(Manifest::parse(GOOD).unwrap().networks.len(), 1);
    for (from, to, told) in [
        ("\"mine\"", "\"mi ne\"", "field name"),
        ("mine/net.onnx", "../net.onnx", "field file"),
        ("mine/net.onnx", "/etc/net.onnx", "field file"),
        ("\"CC0\"", "\"\"", "field licence"),
        ("width = 64", "width = 0", "field input.width"),
        ("width = 64", "width = 100000", "field input.width"),
        ("width = 64,", "", "width"),
        ("width = 64", "width = 64, std = [1, 0, 1]", "field input.std"),
        ("width = 64", "width = 64, mean = [nan, 0, 1]", "field input.mean"),
        ("width = 64", "width = 64, multiple = 0", "field input.multiple"),
        ("width = 64", "width = 64, shortest = 600, longest = 500", "field input.longest"),
        ("\"logits\"", "\"depth\"", "field output: does not fit the task"),
        ("\"logits\"", "\"logits\", first_class = 1000000000000", "field output.first_class"),
        ("\"logits\"", "\"lodgings\"", "lodgings"),
        ("classes = \"home\"", "", "field classes"),
        ("\"home\"", "\"house\"", "house"),
        ("licence", "license", "license"),
        ("classes", "sha256 = \"12\"\nclasses", "field sha256"),
        (
            "\"export\", how = \"by hand\"",
            "\"https\", url = \"http://a\"",
            "source.url: must begin with https://",
        ),
        ("\"export\", how = \"by hand\"", "\"https\", url = \"https://a\"", "`sha256sum FILE` prints it"),
        ("\"export\", how = \"by hand\"", "\"built-in\", how = \"by hand\"", "field source.kind"),
        (
            "\"export\", how = \"by hand\"",
            "\"npm\", package = \"--x\", version = \"1\", member = \"m\"",
            "field source.package",
        ),
        (
            "\"export\", how = \"by hand\"",
            "\"npm\", package = \"x\", version = \"1 2\", member = \"m\"",
            "field source.version",
        ),
    ] {
        assert!(GOOD.contains(from), "{from}");
        let error = Manifest::parse(&GOOD.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(error.contains(told), "{to}: {error}");
    }
    let twice = Manifest::parse(&format!("{GOOD}{GOOD}")).unwrap_err().to_string();
    assert!(twice.contains("twice"), "{twice}");
}

#[test]
fn the_users_networks_come_first_and_replace() {
    let folder = tempfile::tempdir().unwrap();
    let same = GOOD.replace("\"mine\"", "\"deeplab-ade20k\"");
    std::fs::write(folder.path().join(FILE), format!("{GOOD}{same}")).unwrap();
    let manifest = Manifest::with_folder(folder.path()).unwrap();
    assert_eq!(manifest.networks[0].name, "mine");
    assert_eq!(manifest.networks.iter().filter(|entry| entry.name == "deeplab-ade20k").count(), 1);
    assert_eq!(manifest.find("deeplab-ade20k").unwrap().licence, "CC0");

    let installed = |task| {
        let found = installed(task, Some(folder.path())).unwrap();
        found.map(|installed| (installed.entry.name, installed.weights))
    };
    assert_eq!(installed(Task::Segmentation), None);
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    std::fs::write(folder.path().join("mine/net.onnx"), b"x").unwrap();
    let path = folder.path().join("mine/net.onnx");
    assert_eq!(installed(Task::Segmentation), Some(("mine".to_owned(), Weights::File(path))));
    assert_eq!(installed(Task::Depth), None);

    std::fs::write(folder.path().join(FILE), vec![b'#'; MAX_BYTES as usize + 1]).unwrap();
    assert!(matches!(Manifest::with_folder(folder.path()), Err(ManifestError::TooLarge)));
}

/// An own network of the same task comes first if its file is there, and so does an own file of the same name.
#[test]
fn built_in_weights_are_replaced_by_own_files() {
    let folder = tempfile::tempdir().unwrap();
    let own = "[[network]]\nname = \"own\"\ntask = \"surface\"\nfile = \"own.onnx\"\nlicence = \"CC0\"\n\
               source = { kind = \"export\", how = \"by hand\" }\n";
    std::fs::write(folder.path().join(FILE), own).unwrap();
    let found = |models| {
        let found = installed(Task::Surface, models).unwrap().expect("the program has one");
        (found.entry.name, matches!(found.weights, Weights::BuiltIn { .. }))
    };
    let built_in = ("columns".to_owned(), true);
    assert_eq!((found(None), found(Some(folder.path()))), (built_in.clone(), built_in));
    std::fs::create_dir(folder.path().join("columns")).unwrap();
    std::fs::write(folder.path().join("columns/columns.onnx"), b"x").unwrap();
    assert_eq!(found(Some(folder.path())), ("columns".to_owned(), false));
    std::fs::write(folder.path().join("own.onnx"), b"x").unwrap();
    assert_eq!(found(Some(folder.path())), ("own".to_owned(), false));
}

#[test]
fn the_scale_of_depth_is_a_number_above_zero() {
    let written = |scale: &str| {
        let text = GOOD
            .replace("\"segmentation\"", "\"depth\"")
            .replace("classes = \"home\"", "")
            .replace("kind = \"logits\"", &format!("kind = \"depth\", scale = {scale}"));
        Manifest::parse(&text)
    };
    assert!(written("0.001").is_ok());
    for scale in ["0.0", "-1.0", "nan", "inf"] {
        let error = written(scale).expect_err(scale).to_string();
        assert!(error.contains("field output.scale: must be a number above zero"), "{scale}: {error}");
    }
}

#[test]
fn diffusion_has_settings_within_bounds() {
    let written = |settings: &str| {
        let text = GOOD
            .replace("\"segmentation\"", "\"inpainting\"")
            .replace("classes = \"home\"", "")
            .replace("kind = \"logits\"", &format!("kind = \"diffusion\"{settings}"));
        Manifest::parse(&text).map(|manifest| manifest.networks[0].output.clone())
    };
    let Ok(Some(Output::Diffusion(plain))) = written("") else { panic!("{:?}", written("")) };
    assert_eq!((plain.steps, plain.guidance, plain.scheduler), (30, 7.5, Scheduler::Ddim));
    let Ok(Some(Output::Diffusion(own))) =
        written(", steps = 50, scheduler = \"euler\", prompt = \"a hall\"")
    else {
        panic!("refused")
    };
    assert_eq!((own.steps, own.scheduler, own.prompt.as_str()), (50, Scheduler::Euler, "a hall"));
    for (settings, told) in [
        (", steps = 0", "field output.steps"),
        (", steps = 100000", "field output.steps"),
        (", guidance = 0.5", "field output.guidance"),
        (", guidance = nan", "field output.guidance"),
        (", scheduler = \"heun\"", "heun"),
        (", stride = 2", "stride"),
        (&format!(", prompt = \"{}\"", "x".repeat(501)), "field output.prompt"),
    ] {
        let error = written(settings).expect_err(settings).to_string();
        assert!(error.contains(told), "{settings}: {error}");
    }
}
