//! `viola jobs`: lists the clips whose newest job ended without an answer, and queues them again.

use super::args::StoreArguments;
use super::output;
use anyhow::Result;
use clap::{Args, Subcommand, ValueEnum};
use serde_json::json;
use uuid::Uuid;
use viola_storage::{HomeId, Job, JobState, Page, Storage, StorageError, Tenant};

/// Jobs that are looked up at a time.
const BATCH: u32 = 100;

#[derive(Args)]
pub struct JobsArguments {
    #[command(subcommand)]
    command: JobsCommand,
}

#[derive(Subcommand)]
enum JobsCommand {
    /// List the clips whose newest job ended without an answer, with the job's error.
    List(ListArguments),
    /// Queue the clips again whose newest job ended without an answer.
    Retry(Selection),
}

#[derive(Args)]
struct ListArguments {
    #[command(flatten)]
    selection: Selection,
    /// Print a list of objects instead of the table.
    #[arg(long)]
    json: bool,
}

/// The jobs that a command is for.
#[derive(Args)]
struct Selection {
    #[command(flatten)]
    store: StoreArguments,
    /// State of the jobs.
    #[arg(long, value_enum, default_value_t = Ended::Failed)]
    state: Ended,
    /// Code of the jobs' error, for example `worker_died`; default: any.
    #[arg(long, value_name = "CODE")]
    code: Option<String>,
    /// Tenant of the jobs; default: all tenants.
    #[arg(long, value_name = "NAME")]
    tenant: Option<Tenant>,
    /// Home of the jobs; default: all homes.
    #[arg(long, value_name = "ID")]
    home: Option<HomeId>,
}

/// A state in which a job ends without an answer.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Ended {
    Failed,
    Cancelled,
}

impl Selection {
    /// Returns the jobs: the newest of their clips, by tenant, the newest first.
    async fn jobs(&self, storage: &Storage) -> Result<Vec<Job>, StorageError> {
        let state = match self.state {
            Ended::Failed => JobState::Failed,
            Ended::Cancelled => JobState::Cancelled,
        };
        let tenants = match &self.tenant {
            Some(tenant) => vec![tenant.clone()],
            None => storage.tenants().await?,
        };
        let mut found = Vec::new();
        for tenant in tenants {
            let mut page: Page<Uuid> = Page { limit: BATCH, after: None };
            loop {
                let jobs = storage.jobs(&tenant, &[state], &page).await?;
                let Some(last) = jobs.last().map(|job| job.id) else { break };
                page.after = Some(last);
                for job in jobs {
                    if self.has(&job) && is_newest(storage, &job).await? {
                        found.push(job);
                    }
                }
            }
        }
        Ok(found)
    }

    fn has(&self, job: &Job) -> bool {
        self.home.as_ref().is_none_or(|home| home.as_str() == job.home.as_str())
            && self.code.as_deref().is_none_or(|code| Some(code) == code_of(job))
    }
}

/// Returns whether a job is the newest of its clip: a clip keeps earlier ones.
async fn is_newest(storage: &Storage, job: &Job) -> Result<bool, StorageError> {
    match storage.clip(&job.home, job.clip).await {
        Ok(clip) => Ok(clip.job.is_some_and(|newest| newest.id == job.id)),
        // It was removed meanwhile.
        Err(StorageError::NoSuchHome | StorageError::NoSuchClip) => Ok(false),
        Err(error) => Err(error),
    }
}

fn code_of(job: &Job) -> Option<&str> {
    job.error.as_ref().map(|error| error.code.as_str())
}

pub fn run(arguments: &JobsArguments) -> Result<()> {
    match &arguments.command {
        JobsCommand::List(arguments) => list(arguments),
        JobsCommand::Retry(selection) => retry(selection),
    }
}

fn list(arguments: &ListArguments) -> Result<()> {
    let selection = &arguments.selection;
    let jobs = selection.store.administer(async |storage| Ok(selection.jobs(storage).await?))?;
    let document = |job: &Job| {
        json!({"id": job.id, "tenant": job.home.tenant(), "home": job.home.as_str(), "clip": job.clip,
            "state": job.state, "error": job.error, "finished_at": job.finished_at})
    };
    let head = ["tenant", "home", "clip", "state", "code", "ended"];
    output::print_list(&jobs, arguments.json, document, head, |job| {
        let ended = job.finished_at.map(|at| at.strftime("%Y-%m-%d %H:%M").to_string());
        [
            job.home.tenant().to_owned(),
            job.home.as_str().to_owned(),
            job.clip.to_string(),
            job.state.name().to_owned(),
            code_of(job).unwrap_or("-").to_owned(),
            ended.unwrap_or_else(|| "-".to_owned()),
        ]
    })
}

fn retry(selection: &Selection) -> Result<()> {
    let (queued, all) = selection.store.administer(async |storage| {
        let jobs = selection.jobs(storage).await?;
        let mut queued = 0;
        for job in &jobs {
            match storage.align_clip(&job.home, job.clip, storage.now()).await {
                Ok(_) => queued += 1,
                // Without a LiDAR map the clip waits for one.
                Err(StorageError::NoLidarMap | StorageError::NoSuchHome | StorageError::NoSuchClip) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok((queued, jobs.len()))
    })?;
    println!("{queued} of {all} clips are queued again");
    Ok(())
}
